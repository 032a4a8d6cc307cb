#include "emitter/plane.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace etendue {
namespace {

/// Solid angle of the rectangle [0, x] × [0, y] at the distance 1, signed.
double solid_angle_to(double x, double y) {
    return std::atan(x * y / std::sqrt(1 + x * x + y * y));
}

}  // namespace

PlaneEmitter::PlaneEmitter(const Transform& to_world, Rectangle rectangle)
    : PointEmitter(to_world.point({0, 0, 0}), Rgb(1)), to_world_(to_world),
      to_local_(to_world.inverse()), rectangle_(rectangle) {}

Vec3 PlaneEmitter::sample_direction(Vec3, Vec2 u) const {
    const Vec2 uv = distribution_.sample({u.x, u.y}).uv;
    return normalize(to_world_.vector({(2 * uv.x - 1) * float(rectangle_.half_width),
                                       (2 * uv.y - 1) * float(rectangle_.half_height), 1}));
}

Emitter::Emission PlaneEmitter::eval_emission(Vec3, Vec2, uint32_t, Vec3 w) const {
    Vec2 uv;
    float cos_theta;
    if (!to_rectangle(w, uv, cos_theta)) return {Rgb(), 0};
    return {intensity_at(uv, cos_theta), density(uv, cos_theta)};
}

Rgb PlaneEmitter::intensity(Vec3 d) const {
    Vec2 uv;
    float cos_theta;
    return to_rectangle(d, uv, cos_theta) ? intensity_at(uv, cos_theta) : Rgb();
}

float PlaneEmitter::pdf_direction(Vec3 d) const {
    Vec2 uv;
    float cos_theta;
    return to_rectangle(d, uv, cos_theta) ? density(uv, cos_theta) : 0;
}

float PlaneEmitter::density(Vec2 uv, float cos_theta) const {
    // dA/dω = 1 / cos³ θ on the plane.
    return distribution_.pdf(uv) / (float(area()) * cos_theta * cos_theta * cos_theta);
}

bool PlaneEmitter::to_rectangle(Vec3 d, Vec2& uv, float& cos_theta) const {
    const Vec3 w = normalize(to_local_.vector(d));
    cos_theta = w.z;
    if (!(cos_theta > 0)) return false;
    uv = {0.5f + 0.5f * w.x / (cos_theta * float(rectangle_.half_width)),
          0.5f + 0.5f * w.y / (cos_theta * float(rectangle_.half_height))};
    return uv.x >= 0 && uv.x < 1 && uv.y >= 0 && uv.y < 1;
}

double PlaneEmitter::solid_angle(int x, int y, int width, int height) const {
    const double w = std::fabs(rectangle_.half_width), h = std::fabs(rectangle_.half_height),
                 x0 = w * (2.0 * x / width - 1), x1 = w * (2.0 * (x + 1) / width - 1),
                 y0 = h * (2.0 * y / height - 1), y1 = h * (2.0 * (y + 1) / height - 1);
    return solid_angle_to(x1, y1) - solid_angle_to(x0, y1) - solid_angle_to(x1, y0) +
           solid_angle_to(x0, y0);
}

void PlaneEmitter::set_powers(std::span<const float> powers, int width, int height) {
    power_ = 0;
    for (const float p : powers) power_ += double(p);
    distribution_ = PiecewiseConstant2D(powers, width, height);
    // The density of a cell is largest at its corner farthest from the axis.
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const auto far = [](double half, int i, int n) {
                return std::max(std::fabs(half * (2.0 * i / n - 1)),
                                std::fabs(half * (2.0 * (i + 1) / n - 1)));
            };
            const double far_x = far(rectangle_.half_width, x, width),
                         far_y = far(rectangle_.half_height, y, height);
            const float cos_theta =
                float(1 / std::sqrt(1 + far_x * far_x + far_y * far_y)) * (1 - 1e-5f);
            const Vec2 centre{(float(x) + 0.5f) / float(width), (float(y) + 0.5f) / float(height)};
            max_pdf_d_ = std::max(max_pdf_d_, density(centre, cos_theta));
        }
}

void PlaneEmitter::sample_powers(int width, int height) {
    constexpr int kPoints = 4;  // each way
    constexpr double kFloor = 0.05;
    std::vector<float> powers;
    powers.reserve(size_t(width) * size_t(height));
    double sum = 0;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            double power = 0;
            for (int i = 0; i < kPoints * kPoints; ++i) {
                const Vec2 uv{(float(x) + (float(i % kPoints) + 0.5f) / kPoints) / float(width),
                              (float(y) + (float(i / kPoints) + 0.5f) / kPoints) / float(height)};
                const double px = (2 * double(uv.x) - 1) * rectangle_.half_width,
                             py = (2 * double(uv.y) - 1) * rectangle_.half_height;
                const double cos_theta = 1 / std::sqrt(1 + px * px + py * py);
                power += double(luminance(intensity_at(uv, float(cos_theta)))) * cos_theta *
                         cos_theta * cos_theta;
            }
            power *= area() / (double(width) * height * kPoints * kPoints);
            powers.push_back(float(power));
            sum += power;
        }
    // The points may miss the light of a cell.
    const auto least = float(kFloor * sum / (double(width) * height));
    for (float& p : powers) p += least;
    set_powers(powers, width, height);
    power_ = sum;
}

}  // namespace etendue
