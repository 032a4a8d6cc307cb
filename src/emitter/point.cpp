// Emitters at a point: `point`, with the same intensity in all directions, and `spot`, a cone whose intensity decreases
// between beam width and cut-off. y_0 is discrete, and G has no cosine there.

#include "emitter/point.h"

#include <numbers>

#include <fmt/format.h>

#include "description/view.h"
#include "emitter/plane.h"
#include "math/frame.h"

namespace etendue {
namespace {

class SpotEmitter final : public PointEmitter {
public:
    SpotEmitter(Vec3 p, Vec3 axis, Rgb intensity, const Beam& beam)
        : PointEmitter(p, intensity), frame_(Frame::from_normal(axis)), beam_(beam) {}

    Vec3 sample_direction(Vec3, Vec2 u) const override {
        return frame_.to_world(sample_uniform_cone(u, beam_.versine_of_cutoff()));
    }
    float max_pdf_d() const override { return pdf_uniform_cone(beam_.versine_of_cutoff()); }
    double power() const override { return luminance(intensity_) * beam_.integral(); }

private:
    Rgb intensity(Vec3 d) const override { return intensity_ * beam_.share(versine(d, frame_.n)); }
    float pdf_direction(Vec3 d) const override {
        const float most = beam_.versine_of_cutoff();
        return versine(d, frame_.n) < most ? pdf_uniform_cone(most) : 0.0f;
    }

    Frame frame_;
    Beam beam_;
};

/// Cells of a density that resolves a texture, but not much more than its beam or image needs.
void density_cells(const TextureRef& texture, int& width, int& height) {
    constexpr int kLeast = 32, kMost = 2048;
    texture.resolution(width, height);
    width = std::clamp(width, kLeast, kMost);
    height = std::clamp(height, kLeast, kMost);
}

/// A spot light with a texture over the square around its cone, u along x and v along y.
class TexturedSpotEmitter final : public PlaneEmitter {
public:
    TexturedSpotEmitter(const Transform& to_world, Rgb intensity, const Beam& beam,
                        TextureRef texture)
        : PlaneEmitter(to_world, {double(beam.tan_cutoff()), double(beam.tan_cutoff())}),
          peak_(intensity), beam_(beam), texture_(texture) {
        int width, height;
        density_cells(texture, width, height);
        sample_powers(width, height);
    }

private:
    Rgb intensity_at(Vec2 uv, float) const override {
        const Vec2 across = (uv * 2 - Vec2{1, 1}) * beam_.tan_cutoff();
        const float share = beam_.share_on_plane(sqr(across.x) + sqr(across.y));
        return share > 0 ? peak_ * texture_.eval(TexturePoint(uv)) * share : Rgb();
    }

    Rgb peak_;
    Beam beam_;
    TextureRef texture_;
};

/// The counterpart of a perspective camera: the irradiance on the plane z = 1 is π times a texture.
class ProjectorEmitter final : public PlaneEmitter {
public:
    ProjectorEmitter(const Transform& to_world, Rectangle rectangle, TextureRef irradiance,
                     float scale)
        : PlaneEmitter(to_world, rectangle), irradiance_(irradiance), scale_(scale) {
        int width, height;
        density_cells(irradiance, width, height);
        sample_powers(width, height);
    }
    /// That of a camera whose image has the width over height `aspect`; x is to the left, y up, v down.
    static Rectangle rectangle(double half_width, double aspect) {
        return {-half_width, -half_width / aspect};
    }

private:
    Rgb intensity_at(Vec2 uv, float cos_theta) const override {
        return irradiance_.eval(TexturePoint(uv)) *
               (scale_ * kPi / (cos_theta * cos_theta * cos_theta));
    }

    TextureRef irradiance_;
    float scale_;
};

}  // namespace

float Beam::share(float versine) const {
    if (versine >= versine_of_cutoff_) return 0;
    if (versine <= versine_of_beam_) return 1;
    const float x = (versine_of_cutoff_ - versine) / (versine_of_cutoff_ - versine_of_beam_);
    switch (falloff_) {
    case Falloff::Smooth: return sqr(x) * (3 - 2 * x);
    case Falloff::Quadratic: return sqr(x);
    case Falloff::Quartic: return sqr(sqr(x));
    default: return (cutoff_ - 2 * std::asin(std::sqrt(versine / 2))) / (cutoff_ - beam_);
    }
}

double Beam::integral() const {
    const double mean = falloff_ == Falloff::Quartic     ? 0.2
                        : falloff_ == Falloff::Quadratic ? 1.0 / 3
                                                         : 0.5;  // of the ring
    return 2 * std::numbers::pi *
           (double(versine_of_beam_) +
            mean * (double(versine_of_cutoff_) - double(versine_of_beam_)));
}

Beam read_beam(const Params& p) {
    const float cutoff = p.number("cutoff_angle", 20, 0.01f, 179.9f);
    const float beam = p.number("beam_width", cutoff * 0.75f, 0, 179.9f);
    if (beam > cutoff)
        p.fail(
            "beam_width",
            fmt::format("\"beam_width\" is {}, but must not exceed \"cutoff_angle\", which is {}",
                        beam, cutoff));
    return {cutoff, beam,
            Beam::Falloff(p.choice("falloff", {"angle", "smooth", "quartic", "quadratic"}, 0))};
}

Transform similarity(const Params& params, const char* name) {
    const Transform t = params.transform(name);
    const Vec3 x = t.vector({1, 0, 0}), y = t.vector({0, 1, 0}), z = t.vector({0, 0, 1});
    const float size = length(x), tolerance = 1e-3f * size;
    if (std::fabs(length(y) - size) > tolerance || std::fabs(length(z) - size) > tolerance ||
        std::fabs(dot(x, y)) > tolerance * size || std::fabs(dot(y, z)) > tolerance * size ||
        std::fabs(dot(z, x)) > tolerance * size)
        params.fail(
            name, fmt::format("\"{}\" of emitter \"{}\" may rotate, mirror, move and scale by the "
                              "same factor along all axes, but not distort",
                              name, params.object().type));
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
              {"texture", ParamKind::Texture, "1",
               "Factor of the intensity over the square that the cone touches on a plane across "
               "the beam, u along x and v along y."},
              {"to_world", ParamKind::Transform, "identity",
               "Its origin is the light's position, and its +z axis is that of the beam."}}},
            [](const Params& p, EmitterContext& c) {
                const Transform t = p.transform("to_world");
                const Beam beam = read_beam(p);
                const Rgb intensity = p.rgb("intensity", Rgb(1));
                const TextureRef texture = c.texture(p, "texture", Rgb(1));
                if (texture.is_constant())
                    return one_emitter(std::make_unique<SpotEmitter>(
                        t.point({0, 0, 0}), normalize(t.vector({0, 0, 1})),
                        intensity * texture.mean(), beam));
                constexpr float kWidest = 89;
                const float cutoff = p.number("cutoff_angle", 20);
                if (cutoff > kWidest)
                    p.fail("texture", fmt::format("a spot light with a texture needs a "
                                                  "\"cutoff_angle\" of at most {}, but it is {}",
                                                  kWidest, cutoff));
                return one_emitter(std::make_unique<TexturedSpotEmitter>(similarity(p, "to_world"),
                                                                         intensity, beam, texture));
            }};
}

namespace {

std::vector<ParamInfo> projector_params() {
    return concat(
        {{{"irradiance", ParamKind::Texture, "1",
           "Texture of the image plane at the distance 1; the irradiance there, in W/m², is π "
           "times its value. Its upper edge is that of +y, its left edge that of +x."},
          {"scale", ParamKind::Float, "1", "Factor on the irradiance."},
          {"to_world", ParamKind::Transform, "identity",
           "Similarity: its origin is the position, and its +z axis the middle of the image."}},
         view_params("that of the texture")});
}

}  // namespace

EmitterEntry projector_entry() {
    return {
        {"emitter", "projector",
         "Counterpart of a perspective camera: projects a texture along +z; importance-sampled.",
         projector_params()},
        [](const Params& p, EmitterContext& c) {
            const TextureRef irradiance = c.texture(p, "irradiance", Rgb(1));
            int width, height;
            irradiance.resolution(width, height);
            const double aspect = p.has("aspect") ? double(p.number("aspect", 1, 1e-6f, 1e6f))
                                                  : double(width) / height;
            return one_emitter(std::make_unique<ProjectorEmitter>(
                similarity(p, "to_world"),
                ProjectorEmitter::rectangle(view_half_width(p, aspect), aspect), irradiance,
                p.number("scale", 1, 0)));
        }};
}

}  // namespace etendue
