// Environment in the equal-area octahedral projection: every pixel covers the same solid angle, so the density of its
// image is that of directions over 4π.

#include <cmath>
#include <numbers>

#include "emitter/environment.h"
#include "math/distribution.h"
#include "math/warp.h"
#include "system/huge_pages.h"

namespace etendue {
namespace {

class EqualAreaEmitter final : public InfiniteEmitter {
public:
    EqualAreaEmitter(int size, std::vector<Rgb> pixels, const Transform& to_world)
        : size_(size), pixels_(std::move(pixels)), to_world_(to_world),
          to_local_(to_world.inverse()) {
        std::vector<float> weights(pixels_.size());
        for (size_t i = 0; i < weights.size(); ++i) {
            weights[i] = luminance(pixels_[i]);
            mean_ += weights[i] / double(weights.size());
        }
        distribution_ = PiecewiseConstant2D(weights, size, size);
        prefer_huge_pages(pixels_);
        distribution_.for_each_large_array([](const auto& a) { prefer_huge_pages(a); });
    }

    bool has_large_tables() const override { return true; }
    int prefetch_search(FinePoint u) const override { return distribution_.prefetch_row(u); }
    void prefetch_result(FinePoint u, int y) const override {
        prefetch(pixels_[size_t(y) * size_t(size_) + size_t(distribution_.cell(u, y))]);
    }
    double power() const override {
        return 4 * std::numbers::pi * std::numbers::pi * sqr(double(scene_radius())) * mean_;
    }

private:
    // As in environment.cpp, a sample has the value and density of the sampled point.
    Sample sample_arrival(FinePoint u) const override {
        const auto s = distribution_.sample(u);
        return {normalize(to_world_.vector(equal_area_direction(s.uv))), radiance(s.uv),
                s.pdf * kUniformSpherePdf};
    }
    float pdf_direction(Vec3 d) const override { return pdf(square(d)); }
    Rgb radiance(Vec3 d) const override { return radiance(square(d)); }
    Arrival arrival(Vec3 d) const override {
        const Vec2 uv = square(d);
        return {radiance(uv), pdf(uv)};
    }

    float pdf(Vec2 uv) const { return distribution_.pdf(uv) * kUniformSpherePdf; }
    Rgb radiance(Vec2 uv) const {
        const int x = std::min(int(uv.x * float(size_)), size_ - 1),
                  y = std::min(int(uv.y * float(size_)), size_ - 1);
        return pixels_[size_t(y) * size_t(size_) + size_t(x)];
    }
    Vec2 square(Vec3 d) const { return equal_area_square(normalize(to_local_.vector(d))); }

    int size_;
    std::vector<Rgb> pixels_;
    Transform to_world_, to_local_;
    PiecewiseConstant2D distribution_;
    double mean_ = 0;  ///< Mean luminance over the sphere.
};

}  // namespace

Vec3 equal_area_direction(Vec2 square) {
    const float u = 2 * square.x - 1, v = 2 * square.y - 1, a = std::fabs(u), b = std::fabs(v);
    const float signed_distance = 1 - (a + b);  // to the diagonal, which is the equator
    const float r = 1 - std::fabs(signed_distance);
    const float phi = r == 0 ? 0 : ((b - a) / r + 1) * kPi / 4;
    const float s = r * std::sqrt(std::max(2 - r * r, 0.0f));
    return {std::copysign(std::cos(phi), u) * s, std::copysign(std::sin(phi), v) * s,
            std::copysign(1 - r * r, signed_distance)};
}

Vec2 equal_area_square(Vec3 d) {
    const float x = std::fabs(d.x), y = std::fabs(d.y);
    const float r = std::sqrt(std::max(1 - std::fabs(d.z), 0.0f));
    const float v = x == 0 && y == 0 ? 0 : std::atan2(y, x) * (2 / kPi) * r, u = r - v;
    const Vec2 corner = d.z < 0 ? Vec2{1 - v, 1 - u} : Vec2{u, v};
    const auto to_unit = [](float t, float sign) {
        return clamp(0.5f * (std::copysign(t, sign) + 1), 0, kOneMinusEpsilon);
    };
    return {to_unit(corner.x, d.x), to_unit(corner.y, d.y)};
}

std::unique_ptr<Emitter> make_equal_area_environment(int size, std::vector<Rgb> pixels,
                                                     const Transform& to_world) {
    return std::make_unique<EqualAreaEmitter>(size, std::move(pixels), to_world);
}

}  // namespace etendue
