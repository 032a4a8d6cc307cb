#include "emitter/environment.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "emitter/point.h"
#include "image/image_io.h"
#include "math/distribution.h"
#include "system/huge_pages.h"

namespace etendue {
namespace {

/// The image is interpolated bilinearly between pixel centres. The cells of the sampling density extend between centres
/// as well, so that the density of a cell is zero only where the image is zero in the whole cell.
class EnvironmentEmitter final : public InfiniteEmitter {
public:
    EnvironmentEmitter(int width, int height, std::vector<Rgb> pixels, const Transform& to_world)
        : width_(width), height_(height), pixels_(std::move(pixels)), to_world_(to_world),
          to_local_(to_world.inverse()) {
        // height + 1 rows of cells: above the first row of centres, between adjacent rows, and below the last row.
        std::vector<float> weights(size_t(width) * (height + 1));
        // A power of two, so that sums of the largest numbers are finite, and others have the same digits.
        float largest = 0;
        for (const Rgb& c : pixels_) largest = std::max(largest, c.max());
        const float scale = largest > 0x1p96f ? 0x1p-64f : 1.0f;
        for (int y = 0; y <= height; ++y) {
            const double top = std::max(0.0, (y - 0.5) / height),
                         bottom = std::min(1.0, (y + 0.5) / height);
            // Integral of sin θ over the row, up to a constant.
            const double area =
                std::cos(std::numbers::pi * top) - std::cos(std::numbers::pi * bottom);
            for (int x = 0; x < width; ++x) {
                const Rgb sum = texel(x, y - 1) * scale + texel(x + 1, y - 1) * scale +
                                texel(x, y) * scale + texel(x + 1, y) * scale;
                weights[size_t(y) * width + x] = float(0.25 * luminance(sum) * area);
                mean_ += 0.25 * luminance(sum) * area / width / 2;
            }
        }
        mean_ /= double(scale);
        distribution_ = PiecewiseConstant2D(weights, width, height + 1);
        prefer_huge_pages(pixels_);
        distribution_.for_each_large_array([](const auto& a) { prefer_huge_pages(a); });
    }

    int prefetch_search(FinePoint u) const override { return distribution_.prefetch_row(u); }
    void prefetch_result(FinePoint u, int y) const override {
        // The corners of a cell are the centres of four pixels.
        const int x = distribution_.cell(u, y);
        for (const Rgb* above_or_below : {row(y - 1), row(y)}) {
            prefetch(above_or_below[x]);
            prefetch(above_or_below[wrap(x + 1)]);
        }
    }
    bool has_large_tables() const override { return true; }
    double power() const override {
        return 4 * std::numbers::pi * std::numbers::pi * sqr(double(scene_radius())) * mean_;
    }

private:
    // The unit square of distribution_ has the columns of cells along x and the height + 1 rows along y. The first and
    // the last row have half the height of the others in the image. Value and density of a sample are those of the
    // sampled point, not of the rounded direction, which may lie in the next cell.
    Sample sample_arrival(FinePoint u) const override {
        const auto s = distribution_.sample(u);
        Vec2 uv{s.uv.x + 0.5f / float(width_), to_image_v(s.uv.y)};
        if (uv.x >= 1) uv.x -= 1;
        float sp, cp, ct, sin_theta;
        sincosf(2 * kPi * uv.x, &sp, &cp);
        sincosf(kPi * uv.y, &sin_theta, &ct);
        return {normalize(to_world_.vector({sp * sin_theta, ct, -cp * sin_theta})), radiance(uv),
                density(s.pdf, {uv, sin_theta})};
    }
    float pdf_direction(Vec3 d) const override { return pdf(to_place(d)); }
    Rgb radiance(Vec3 d) const override { return radiance(to_place(d).uv); }
    Arrival arrival(Vec3 d) const override {
        const Place at = to_place(d);
        return {radiance(at.uv), pdf(at)};
    }

    /// A point of the image, with the sine of its polar angle.
    struct Place {
        Vec2 uv;
        float sin_theta;
    };
    float pdf(const Place& at) const {
        float x = at.uv.x - 0.5f / float(width_);
        if (x < 0) x += 1;
        return density(distribution_.pdf({x, to_cell_v(at.uv.y)}), at);
    }
    /// The density in solid angle, from the density in the unit square of distribution_.
    float density(float in_square, const Place& at) const {
        if (!(at.sin_theta > 0)) return 0;
        return in_square * cell_v_derivative(at.uv.y) / (2 * kPi * kPi * at.sin_theta);
    }

    Rgb radiance(Vec2 uv) const {
        const float x = uv.x * float(width_) - 0.5f, y = uv.y * float(height_) - 0.5f;
        const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
        const float fx = x - float(x0), fy = y - float(y0);
        const size_t left = size_t(wrap(x0)), right = size_t(wrap(x0 + 1));
        const Rgb *above = row(y0), *below = row(y0 + 1);
        return lerp(fy, lerp(fx, above[left], above[right]), lerp(fx, below[left], below[right]));
    }

    /// From image coordinate v to the y of distribution_, in [0, 1); piecewise linear.
    float to_cell_v(float v) const {
        const float y = v * float(height_);
        const float rows = float(height_ + 1);
        if (y < 0.5f) return 2 * y / rows;
        if (y >= float(height_) - 0.5f)
            return std::min((float(height_) + 2 * (y - float(height_) + 0.5f)) / rows,
                            kOneMinusEpsilon);
        return (y + 0.5f) / rows;
    }
    float to_image_v(float cell_v) const {
        const float c = cell_v * float(height_ + 1);
        if (c < 1) return 0.5f * c / float(height_);
        if (c >= float(height_))
            return (float(height_) - 0.5f + 0.5f * (c - float(height_))) / float(height_);
        return (c - 0.5f) / float(height_);
    }
    /// d to_cell_v / dv
    float cell_v_derivative(float v) const {
        const float y = v * float(height_);
        const float slope = float(height_) / float(height_ + 1);
        return y < 0.5f || y >= float(height_) - 0.5f ? 2 * slope : slope;
    }

    Place to_place(Vec3 d) const {
        const Vec3 w = normalize(to_local_.vector(d));
        float u = std::atan2(w.x, -w.z) / (2 * kPi);
        if (u < 0) u += 1;
        const float sin_theta = std::sqrt(sqr(w.x) + sqr(w.z));
        // Near the poles acos(w.y) would be far less exact.
        const float v = std::atan2(sin_theta, w.y) / kPi;
        return {{std::min(u, kOneMinusEpsilon), std::min(v, kOneMinusEpsilon)}, sin_theta};
    }

    /// The image repeats along x, beyond its edges by at most its width.
    int wrap(int x) const { return x < 0 ? x + width_ : x >= width_ ? x - width_ : x; }
    const Rgb* row(int y) const {
        return &pixels_[size_t(std::clamp(y, 0, height_ - 1)) * size_t(width_)];
    }
    Rgb texel(int x, int y) const { return row(y)[wrap(x)]; }

    int width_, height_;
    std::vector<Rgb> pixels_;
    Transform to_world_, to_local_;
    PiecewiseConstant2D distribution_;
    double mean_ = 0;  ///< Mean luminance over the sphere.
};

/// The parameter that names the image.
const char* image_parameter(const Params& p) {
    return embedded_image(p) ? "image" : "filename";
}

}  // namespace

std::unique_ptr<Emitter> make_environment(int width, int height, std::vector<Rgb> pixels,
                                          const Transform& to_world) {
    return std::make_unique<EnvironmentEmitter>(width, height, std::move(pixels), to_world);
}

RgbImage read_emission_image(const Params& p, Rgb factor) {
    const EncodedImage* const embedded = embedded_image(p);
    const std::string name = embedded ? embedded->name : resolve_file(p);
    RgbImage image;
    try {
        image = embedded ? decode_rgb(embedded->bytes, name) : read_rgb(name);
    } catch (const std::exception& e) {
        p.fail(image_parameter(p), e.what());
    }
    for (Rgb& c : image.pixels) {
        c *= factor;
        if (!is_finite(c) || std::min({c.r, c.g, c.b}) < 0)
            p.fail(image_parameter(p),
                   "image \"" + name + "\" has a pixel that is negative or not finite");
    }
    return image;
}

std::unique_ptr<Emitter> make_environment(const Params& p, RgbImage image,
                                          const Transform& to_world) {
    if (p.choice("projection", {"latlong", "equalarea"}, 0) == 0)
        return make_environment(image.width, image.height, std::move(image.pixels), to_world);
    if (image.width != image.height)
        p.fail(image_parameter(p),
               fmt::format("{}: an image in the equal-area projection is square, but this one has "
                           "{} x {} pixels",
                           embedded_image(p) ? embedded_image(p)->name : p.text("filename", ""),
                           image.width, image.height));
    return make_equal_area_environment(image.width, std::move(image.pixels), to_world);
}

EmitterEntry envmap_entry() {
    return {{"emitter",
             "envmap",
             "Environment map given as an image; importance-sampled.",
             {{"filename", ParamKind::String, "",
               "Image of any supported format; the upper edge of a latitude-longitude image is the "
               "zenith."},
              {"image", ParamKind::Int, "",
               "Index of the image among those of the scene file, from 0, instead of filename."},
              {"scale", ParamKind::Float, "1", "Factor on the radiance."},
              {"tint", ParamKind::Rgb, "1", "Factor on the radiance, by colour."},
              {"projection", ParamKind::String, "latlong",
               "latlong, or equalarea: a square image in pbrt-v4's octahedral projection, +z up."},
              {"to_world", ParamKind::Transform, "identity",
               "Rotation of the environment; its own up direction is +y."},
              {"mis_compensation", ParamKind::Bool, "false", "Accepted; without effect."}}},
            [](const Params& p, EmitterContext&) {
                RgbImage image =
                    read_emission_image(p, p.rgb("tint", Rgb(1)) * p.number("scale", 1, 0));
                std::vector<std::unique_ptr<Emitter>> made;
                const Transform to_world = similarity(p, "to_world");
                made.push_back(make_environment(p, std::move(image), to_world));
                return made;
            }};
}

}  // namespace etendue
