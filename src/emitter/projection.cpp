// A point that projects an image: `projection` of pbrt. The value of a pixel is the intensity toward it. Directions are
// sampled with the density of the image.
//   filename               image, seen upright from the light with +x to the right and +y up
//   intensity (1)          factor of the image, in W/sr
//   power                  power in W, weighted by luminance, to which the intensity is scaled
//   fov (90)               full angle over the shorter side of the image, in degrees
//   to_world (identity)    similarity; its origin is the light's position, +z the middle of the image

#include <algorithm>
#include <cmath>
#include <numbers>

#include "emitter/environment.h"
#include "emitter/plane.h"

namespace etendue {
namespace {

class ProjectionEmitter final : public PlaneEmitter {
public:
    ProjectionEmitter(const Transform& to_world, RgbImage image, float fov_degrees)
        : PlaneEmitter(to_world, rectangle(image, fov_degrees)), image_(std::move(image)) {
        std::vector<float> powers;
        powers.reserve(image_.pixels.size());
        for (int y = 0; y < image_.height; ++y)
            for (int x = 0; x < image_.width; ++x)
                powers.push_back(float(double(luminance(pixel(x, y))) *
                                       solid_angle(x, y, image_.width, image_.height)));
        set_powers(powers, image_.width, image_.height);
    }

    /// v goes down.
    static Rectangle rectangle(const RgbImage& image, float fov_degrees) {
        const double half = std::tan(double(fov_degrees) * std::numbers::pi / 360);
        const double shorter = std::min(image.width, image.height);
        return {half * image.width / shorter, -half * image.height / shorter};
    }

private:
    Rgb intensity_at(Vec2 uv, float) const override {
        return pixel(std::min(int(uv.x * float(image_.width)), image_.width - 1),
                     std::min(int(uv.y * float(image_.height)), image_.height - 1));
    }
    Rgb pixel(int x, int y) const {
        return image_.pixels[size_t(y) * size_t(image_.width) + size_t(x)];
    }

    RgbImage image_;
};

}  // namespace

ProjectionLight read_projection(const Params& p) {
    ProjectionLight light{.fov = p.number("fov", 90, 0.01f, 179)};
    scaled_to_power(p, read_emission_image(p, p.rgb("intensity", Rgb(1))), [&](RgbImage image) {
        light.image = image;
        return std::make_unique<ProjectionEmitter>(Transform(), std::move(image), light.fov);
    });
    const auto [half_width, half_height] = ProjectionEmitter::rectangle(light.image, light.fov);
    light.half_width = half_width;
    light.half_height = -half_height;
    return light;
}

EmitterEntry projection_entry() {
    return {{"emitter",
             "projection",
             "Point light that projects an image along +z; importance-sampled.",
             {{"filename", ParamKind::String, "",
               "Image of any supported format, the intensity toward its pixels; seen from the "
               "light, +x is to the right and +y is up."},
              {"intensity", ParamKind::Rgb, "1", "Factor on the image, in W/sr."},
              {"power", ParamKind::Float, "",
               "Power in W, weighted by luminance, to which the intensity is scaled."},
              {"fov", ParamKind::Float, "90",
               "Full angle in degrees over the shorter side of the image."},
              {"to_world", ParamKind::Transform, "identity",
               "Similarity: its origin is the light's position, its +z axis that of the image."}}},
            [](const Params& p, EmitterContext&) {
                ProjectionLight light = read_projection(p);
                return one_emitter(std::make_unique<ProjectionEmitter>(
                    similarity(p, "to_world"), std::move(light.image), light.fov));
            }};
}

}  // namespace etendue
