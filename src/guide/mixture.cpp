#include "guide/mixture.h"

#include <cmath>
#include <numbers>

#include "guide/exp_negative.h"
#include "math/frame.h"

namespace etendue {

/// Eight lobes as seen from a place: their means, and their masses w_k A_k.
struct GuideMixture::Seen {
    alignas(32) std::array<float, kLanes> x, y, z, mass;
};

void GuideMixture::add(const Lobe& lobe) {
    const auto k = size_t(size_++);
    x_[k] = lobe.mean.x, y_[k] = lobe.mean.y, z_[k] = lobe.mean.z;
    inv_r_[k] = lobe.inv_r;
    const double kappa = double(kappa_[k] = clamp(lobe.kappa, kLeastKappa, kMostKappa));
    const double e = std::exp(-2 * kappa);
    norm_[k] = float(kappa / (2 * std::numbers::pi * -std::expm1(-2 * kappa)));
    rho_[k] = float((1 + e) / (1 - e) - 1 / kappa);
    weight_[k] = lobe.weight;
}

GuideMixture::Lobe GuideMixture::lobe(int k) const {
    const auto i = size_t(k);
    return {{x_[i], y_[i], z_[i]}, inv_r_[i], kappa_[i], weight_[i]};
}

inline GuideMixture::Seen GuideMixture::see(const GuideView& view, int first) const {
    Seen seen;
    const Vec3 c = view.to_center, n = view.normal;
    const bool one_sided = length2(n) > 0;
    for (size_t j = 0; j < size_t(kLanes); ++j) {
        const size_t k = size_t(first) + j;
        const float x = x_[k] + c.x * inv_r_[k], y = y_[k] + c.y * inv_r_[k],
                    z = z_[k] + c.z * inv_r_[k];
        const float len2 = x * x + y * y + z * z;
        // At the lobe's origin all directions are alike.
        const bool is_far = len2 > 1e-8f;
        const float inv_len = 1 / std::sqrt(is_far ? len2 : 1.0f);
        seen.x[j] = is_far ? x * inv_len : x_[k];
        seen.y[j] = is_far ? y * inv_len : y_[k];
        seen.z[j] = is_far ? z * inv_len : z_[k];
        const float cos = n.x * seen.x[j] + n.y * seen.y[j] + n.z * seen.z[j];
        const float above = rho_[k] * (cos > 0 ? cos : 0.0f) + (1 - rho_[k]) * (1 + cos) * 0.25f;
        const float A = above > 1e-3f ? above : 1e-3f;
        seen.mass[j] = weight_[k] * (one_sided ? A : 1.0f);
    }
    return seen;
}

std::vector<GuideMixture::SeenLobe> GuideMixture::seen_lobes(const GuideView& view) const {
    std::vector<SeenLobe> lobes;
    float total = 0;
    for (int k = 0; k < size_; ++k) {
        const Seen seen = see(view, k - k % kLanes);
        const auto j = size_t(k % kLanes);
        lobes.push_back({{seen.x[j], seen.y[j], seen.z[j]}, seen.mass[j]});
        total += seen.mass[j];
    }
    for (SeenLobe& lobe : lobes) lobe.share /= total;
    return lobes;
}

float GuideMixture::pdf(const GuideView& view, Vec3 w) const {
    alignas(32) std::array<float, kLanes> sum{}, mass{};
    for (int first = 0; first < size_; first += kLanes) {
        const Seen seen = see(view, first);
        for (size_t j = 0; j < size_t(kLanes); ++j) {
            const size_t k = size_t(first) + j;
            // 1 - μ·ω = |ω - μ|²/2 without cancellation.
            const float dx = w.x - seen.x[j], dy = w.y - seen.y[j], dz = w.z - seen.z[j];
            const float e = exp_negative(-0.5f * kappa_[k] * (dx * dx + dy * dy + dz * dz));
            sum[j] += seen.mass[j] * norm_[k] * e;
            mass[j] += seen.mass[j];
        }
    }
    float s = 0, m = 0;
    for (size_t j = 0; j < size_t(kLanes); ++j) s += sum[j], m += mass[j];
    return s / m;
}

Vec3 GuideMixture::sample(const GuideView& view, float u_lobe, Vec2 u) const {
    Seen seen[kMostLobes / kLanes];
    float total = 0;
    for (int first = 0; first < size_; first += kLanes) {
        seen[first / kLanes] = see(view, first);
        for (const float m : seen[first / kLanes].mass) total += m;
    }
    float left = u_lobe * total;
    int k = 0;
    const auto mass = [&](int i) { return seen[i / kLanes].mass[size_t(i % kLanes)]; };
    while (k + 1 < size_ && left >= mass(k)) left -= mass(k++);
    const Seen& s = seen[k / kLanes];
    const auto j = size_t(k % kLanes);
    const Vec3 mean{s.x[j], s.y[j], s.z[j]};
    // 1 - cos θ, which is exponentially distributed, as far as it is below 2.
    const float kappa = kappa_[size_t(k)];
    const float versine = std::fmin(std::log1p(u.x * std::expm1(-2 * kappa)) / -kappa, 2.0f);
    const float r = safe_sqrt(versine * (2 - versine)), phi = 2 * kPi * u.y;
    return normalize(
        Frame::from_normal(mean).to_world({r * std::cos(phi), r * std::sin(phi), 1 - versine}));
}

float GuideMixture::max_pdf(const GuideView& view, const DirectionCone& cone) const {
    const Vec3 a = cone.axis;
    const float sin_cone = std::sin(cone.angle), half = std::sin(cone.angle / 2),
                ver_cone = 2 * half * half;
    alignas(32) std::array<float, kLanes> sum{}, mass{};
    for (int first = 0; first < size_; first += kLanes) {
        const Seen seen = see(view, first);
        for (size_t j = 0; j < size_t(kLanes); ++j) {
            const size_t k = size_t(first) + j;
            // 1 - cos(φ - γ) for the angle φ between mean and axis and the cone's angle γ, at least 0.
            const float dx = a.x - seen.x[j], dy = a.y - seen.y[j], dz = a.z - seen.z[j];
            const float sx = a.x + seen.x[j], sy = a.y + seen.y[j], sz = a.z + seen.z[j];
            // 1 - cos φ and 1 + cos φ, neither by a difference.
            const float ver = 0.5f * (dx * dx + dy * dy + dz * dz),
                        beyond = 0.5f * (sx * sx + sy * sy + sz * sz);
            const float sin = std::sqrt(ver * beyond);
            const float both = ver + ver_cone;
            // The slack covers rounding errors.
            const float nearest = both - ver * ver_cone - sin * sin_cone - 2e-6f * both;
            const bool is_outside = ver > ver_cone && nearest > 0;
            sum[j] +=
                seen.mass[j] * norm_[k] * exp_negative(is_outside ? -kappa_[k] * nearest : 0.0f);
            mass[j] += seen.mass[j];
        }
    }
    float s = 0, m = 0;
    for (size_t j = 0; j < size_t(kLanes); ++j) s += sum[j], m += mass[j];
    return s / m * 1.0001f;
}

}  // namespace etendue
