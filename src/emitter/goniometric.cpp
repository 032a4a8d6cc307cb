// A point whose intensity by direction is an image: measured luminaires, `goniometric` of pbrt. Directions are sampled
// with the density of the image, by the environment that has it as its radiance.
//   filename, projection   image over all directions, as for envmap
//   intensity (1)          factor of the image, in W/sr
//   power                  power in W, weighted by luminance, to which the intensity is scaled
//   to_world (identity)    similarity; its origin is the light's position

#include "emitter/environment.h"

#include <numbers>

#include "emitter/point.h"

namespace etendue {
namespace {

class GoniometricEmitter final : public PointEmitter {
public:
    GoniometricEmitter(Vec3 p, std::unique_ptr<Emitter> directions)
        : PointEmitter(p, Rgb(1)), directions_(std::move(directions)) {
        directions_->set_scene_bounds({}, 1);
    }

    Vec3 sample_direction(Vec3, Vec2 u) const override {
        DirectSample s;
        return directions_->sample_direct({}, {u.x, u.y}, s) ? s.wi : Vec3{0, 0, 1};
    }
    Emission eval_emission(Vec3, Vec2, uint32_t, Vec3 w) const override {
        const EmitterHit hit = directions_->eval_infinite(w);
        return {hit.Le, hit.pdf};
    }
    float max_pdf_d() const override { return kInf; }
    double power() const override { return directions_->power() / std::numbers::pi; }  // ∫ I dω

private:
    Rgb intensity(Vec3 d) const override { return directions_->eval_infinite(d).Le; }
    float pdf_direction(Vec3 d) const override { return directions_->eval_infinite(d).pdf; }

    std::unique_ptr<Emitter> directions_;  ///< An environment, whose radiance is the intensity.
};

std::unique_ptr<Emitter> make(const Params& p, RgbImage image, const Transform& to_world) {
    return std::make_unique<GoniometricEmitter>(to_world.point({0, 0, 0}),
                                                make_environment(p, std::move(image), to_world));
}

}  // namespace

std::unique_ptr<Emitter> read_goniometric(const Params& p) {
    const Transform to_world = similarity(p, "to_world");
    return scaled_to_power(p, read_emission_image(p, p.rgb("intensity", Rgb(1))),
                           [&](RgbImage image) { return make(p, std::move(image), to_world); });
}

EmitterEntry goniometric_entry() {
    return {{"emitter",
             "goniometric",
             "Point light whose intensity in each direction is given by an image; "
             "importance-sampled.",
             {{"filename", ParamKind::String, "",
               "Image over all directions, of any supported format."},
              {"intensity", ParamKind::Rgb, "1", "Factor on the image, in W/sr."},
              {"power", ParamKind::Float, "",
               "Power in W, weighted by luminance, to which the intensity is scaled."},
              {"projection", ParamKind::String, "latlong",
               "latlong with +y up, or equalarea: a square image in pbrt-v4's octahedral "
               "projection, +z up."},
              {"to_world", ParamKind::Transform, "identity",
               "Similarity: its origin is the light's position."}}},
            [](const Params& p, EmitterContext&) { return one_emitter(read_goniometric(p)); }};
}

}  // namespace etendue
