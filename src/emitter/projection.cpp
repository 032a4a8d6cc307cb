// A point that projects an image: `projection` of pbrt. The value of a pixel is the intensity toward it. Directions are
// sampled with the density of the image.
//   filename               image, seen upright from the light with +x to the right and +y up
//   intensity (1)          factor of the image, in W/sr
//   power                  power in W, weighted by luminance, to which the intensity is scaled
//   fov (90)               full angle over the shorter side of the image, in degrees
//   to_world (identity)    similarity; its origin is the light's position, +z the middle of the image

#include <algorithm>
#include <cmath>

#include "emitter/environment.h"
#include "emitter/point.h"
#include "math/distribution.h"
#include "math/transform.h"

namespace etendue {
namespace {

/// Solid angle of the rectangle [0, x] × [0, y] at the distance 1, signed.
double solid_angle(double x, double y) {
    return std::atan(x * y / std::sqrt(1 + x * x + y * y));
}

class ProjectionEmitter final : public PointEmitter {
public:
    ProjectionEmitter(const Transform& to_world, RgbImage image, float fov_degrees)
        : PointEmitter(to_world.point({0, 0, 0}), Rgb(1)), image_(std::move(image)),
          to_world_(to_world), to_local_(to_world.inverse()) {
        const double half = std::tan(double(fov_degrees) * double(kPi) / 360);
        const double shorter = std::min(image_.width, image_.height);
        half_width_ = half * image_.width / shorter;
        half_height_ = half * image_.height / shorter;
        std::vector<float> weights;
        weights.reserve(image_.pixels.size());
        for (int y = 0; y < image_.height; ++y)
            for (int x = 0; x < image_.width; ++x) {
                const double power = double(luminance(pixel(x, y))) * solid_angle_of(x, y);
                weights.push_back(float(power));
                power_ += power;
            }
        distribution_ = PiecewiseConstant2D(weights, image_.width, image_.height);
        bound_density();
    }

    Vec3 sample_direction(Vec3, Vec2 u) const override {
        const Vec2 uv = distribution_.sample({u.x, u.y}).uv;
        return normalize(to_world_.vector(
            {(2 * uv.x - 1) * float(half_width_), (1 - 2 * uv.y) * float(half_height_), 1}));
    }
    float max_pdf_d() const override { return max_pdf_d_; }
    double power() const override { return power_; }

private:
    Rgb intensity(Vec3 d) const override {
        Vec2 uv;
        float cos_theta;
        if (!to_image(d, uv, cos_theta)) return Rgb();
        return pixel(std::min(int(uv.x * float(image_.width)), image_.width - 1),
                     std::min(int(uv.y * float(image_.height)), image_.height - 1));
    }
    float pdf_direction(Vec3 d) const override {
        Vec2 uv;
        float cos_theta;
        return to_image(d, uv, cos_theta) ? distribution_.pdf(uv) * density_factor(cos_theta) : 0;
    }
    /// dA/dω = 1 / cos³ θ on the plane at the distance 1, and du dv / dA.
    float density_factor(float cos_theta) const {
        return 1 / (float(4 * half_width_ * half_height_) * cos_theta * cos_theta * cos_theta);
    }
    bool to_image(Vec3 d, Vec2& uv, float& cos_theta) const {
        const Vec3 w = normalize(to_local_.vector(d));
        cos_theta = w.z;
        if (!(cos_theta > 0)) return false;
        uv = {0.5f + 0.5f * w.x / (cos_theta * float(half_width_)),
              0.5f - 0.5f * w.y / (cos_theta * float(half_height_))};
        return uv.x >= 0 && uv.x < 1 && uv.y >= 0 && uv.y < 1;
    }

    /// Edges of columns and rows on the plane.
    double column(int x) const { return half_width_ * (2.0 * x / image_.width - 1); }
    double row(int y) const { return half_height_ * (2.0 * y / image_.height - 1); }
    double solid_angle_of(int x, int y) const {
        const double x0 = column(x), x1 = column(x + 1), y0 = row(y), y1 = row(y + 1);
        return solid_angle(x1, y1) - solid_angle(x0, y1) - solid_angle(x1, y0) +
               solid_angle(x0, y0);
    }
    /// The density of a pixel is largest at its corner farthest from the axis.
    void bound_density() {
        for (int y = 0; y < image_.height; ++y)
            for (int x = 0; x < image_.width; ++x) {
                const double far_x = std::max(std::fabs(column(x)), std::fabs(column(x + 1))),
                             far_y = std::max(std::fabs(row(y)), std::fabs(row(y + 1)));
                const float cos_theta =
                    float(1 / std::sqrt(1 + far_x * far_x + far_y * far_y)) * (1 - 1e-5f);
                const Vec2 centre{(float(x) + 0.5f) / float(image_.width),
                                  (float(y) + 0.5f) / float(image_.height)};
                max_pdf_d_ =
                    std::max(max_pdf_d_, distribution_.pdf(centre) * density_factor(cos_theta));
            }
    }
    Rgb pixel(int x, int y) const {
        return image_.pixels[size_t(y) * size_t(image_.width) + size_t(x)];
    }

    RgbImage image_;
    Transform to_world_, to_local_;
    double half_width_, half_height_;  ///< Of the image on the plane at the distance 1.
    PiecewiseConstant2D distribution_;
    double power_ = 0;
    float max_pdf_d_ = 0;
};

}  // namespace

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
                const Transform to_world = similarity(p, "to_world");
                const float fov = p.number("fov", 90, 0.01f, 179);
                return one_emitter(scaled_to_power(
                    p, read_emission_image(p, p.rgb("intensity", Rgb(1))), [&](RgbImage image) {
                        return std::make_unique<ProjectionEmitter>(to_world, std::move(image), fov);
                    }));
            }};
}

}  // namespace etendue
