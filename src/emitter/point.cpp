// Emitters at a point: `point`, with the same intensity in all directions, and `spot`, a cone whose intensity decreases
// between beam width and cut-off. y_0 is discrete, and G has no cosine there.

#include "emitter/point.h"

#include <fmt/format.h>

#include "math/frame.h"

namespace etendue {
namespace {

/// Intensity between cut-off and beam: linear in the angle (Mitsuba); or of x, the cosine's way from the one to the
/// other, x²(3 − 2x) (pbrt-v4), x⁴ (pbrt-v3) or x² (glTF).
enum class Falloff { Angle, Smooth, Quartic, Quadratic };

class SpotEmitter final : public PointEmitter {
public:
    SpotEmitter(Vec3 p, Vec3 axis, Rgb intensity, float cutoff_degrees, float beam_degrees,
                Falloff falloff)
        : PointEmitter(p, intensity), falloff_(falloff), frame_(Frame::from_normal(axis)),
          cutoff_(cutoff_degrees * kPi / 180), beam_(beam_degrees * kPi / 180),
          cos_cutoff_(std::cos(cutoff_)), cos_beam_(std::cos(beam_)) {}

    Vec3 sample_direction(Vec3, Vec2 u) const override {
        return frame_.to_world(sample_uniform_cone(u, cos_cutoff_));
    }
    float max_pdf_d() const override { return pdf_uniform_cone(cos_cutoff_); }
    double power() const override {
        const double share = falloff_ == Falloff::Quartic     ? 0.2
                             : falloff_ == Falloff::Quadratic ? 1.0 / 3
                                                              : 0.5;  // of the ring, on average
        return 2 * double(kPi) * luminance(intensity_) *
               ((1 - double(cos_beam_)) + share * (double(cos_beam_) - cos_cutoff_));
    }

private:
    Rgb intensity(Vec3 d) const override {
        const float c = dot(d, frame_.n);
        if (c <= cos_cutoff_) return Rgb();
        if (c >= cos_beam_) return intensity_;
        const float x = (c - cos_cutoff_) / (cos_beam_ - cos_cutoff_);
        switch (falloff_) {
        case Falloff::Smooth: return intensity_ * (sqr(x) * (3 - 2 * x));
        case Falloff::Quadratic: return intensity_ * sqr(x);
        case Falloff::Quartic: return intensity_ * sqr(sqr(x));
        default: return intensity_ * ((cutoff_ - std::acos(c)) / (cutoff_ - beam_));
        }
    }
    float pdf_direction(Vec3 d) const override {
        return dot(d, frame_.n) > cos_cutoff_ ? pdf_uniform_cone(cos_cutoff_) : 0.0f;
    }

    Falloff falloff_;
    Frame frame_;
    float cutoff_, beam_, cos_cutoff_, cos_beam_;
};

}  // namespace

Transform similarity(const Params& params, const char* name) {
    const Transform t = params.transform(name);
    const Vec3 x = t.vector({1, 0, 0}), y = t.vector({0, 1, 0}), z = t.vector({0, 0, 1});
    const float size = length(x), tolerance = 1e-3f * size;
    if (std::fabs(length(y) - size) > tolerance || std::fabs(length(z) - size) > tolerance ||
        std::fabs(dot(x, y)) > tolerance * size || std::fabs(dot(y, z)) > tolerance * size ||
        std::fabs(dot(z, x)) > tolerance * size)
        params.fail(name, "the transform of a light with an image may rotate, mirror, move and "
                          "scale by the same factor along all axes, but not distort");
    return t;
}

EmitterEntry point_entry() {
    return {
        {"emitter",
         "point",
         "Isotropic point light.",
         {{"intensity", ParamKind::Rgb, "1", "Radiant intensity in W/sr."},
          {"position", ParamKind::Vector, "0, 0, 0", "Position of the light, instead of to_world."},
          {"to_world", ParamKind::Transform, "identity", "Its origin is the light's position."}}},
        [](const Params& p, EmitterContext&) {
            if (p.has("position") && p.has("to_world"))
                p.fail("to_world", "give either \"position\" or \"to_world\", not both");
            const Vec3 at = p.has("position") ? p.vector("position", {})
                                              : p.transform("to_world").point({0, 0, 0});
            return one_emitter(std::make_unique<PointEmitter>(at, p.rgb("intensity", Rgb(1))));
        }};
}

EmitterEntry spot_entry() {
    return {{"emitter",
             "spot",
             "Spot light along +z.",
             {{"intensity", ParamKind::Rgb, "1", "Radiant intensity within the beam, in W/sr."},
              {"cutoff_angle", ParamKind::Float, "20",
               "Half-angle in degrees beyond which nothing is emitted."},
              {"beam_width", ParamKind::Float, "3/4 of cutoff_angle",
               "Half-angle in degrees up to which the intensity is full."},
              {"falloff", ParamKind::String, "angle",
               "Decrease from beam_width to cutoff_angle: angle (linear in the angle), or a "
               "function of x, the cosine scaled to [0, 1]: smooth (x² (3 - 2x), pbrt-v4), "
               "quartic (x⁴, pbrt-v3) or quadratic (x², glTF)."},
              {"to_world", ParamKind::Transform, "identity",
               "Its origin is the light's position, and its +z axis is that of the beam."}}},
            [](const Params& p, EmitterContext&) {
                const Transform t = p.transform("to_world");
                const float cutoff = p.number("cutoff_angle", 20, 0.01f, 179.9f);
                const float beam = p.number("beam_width", cutoff * 0.75f, 0, 179.9f);
                if (beam > cutoff)
                    p.fail("beam_width", fmt::format("\"beam_width\" is {}, but must not exceed "
                                                     "\"cutoff_angle\", which is {}",
                                                     beam, cutoff));
                return one_emitter(std::make_unique<SpotEmitter>(
                    t.point({0, 0, 0}), normalize(t.vector({0, 0, 1})), p.rgb("intensity", Rgb(1)),
                    cutoff, beam,
                    Falloff(p.choice("falloff", {"angle", "smooth", "quartic", "quadratic"}, 0))));
            }};
}

}  // namespace etendue
