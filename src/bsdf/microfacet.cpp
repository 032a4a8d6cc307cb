#include "bsdf/microfacet.h"

#include <algorithm>

namespace etendue {

namespace {

/// Inverse error function to about single precision [Giles 2012, table 5].
float erf_inv(float x) {
    float w = -std::log((1 - x) * (1 + x));
    float p;
    if (w < 5) {
        w -= 2.5f;
        p = 2.81022636e-08f;
        for (float c : {3.43273939e-07f, -3.5233877e-06f, -4.39150654e-06f, 0.00021858087f,
                        -0.00125372503f, -0.00417768164f, 0.246640727f, 1.50140941f})
            p = c + p * w;
    } else {
        w = std::sqrt(w) - 3;
        p = -0.000200214257f;
        for (float c : {0.000100950558f, 0.00134934322f, -0.00367342844f, 0.00573950773f,
                        -0.0076224613f, 0.00943887047f, 1.00167406f, 2.83297682f})
            p = c + p * w;
    }
    return p * x;
}

/// erf_inv(2u − 1), kept finite.
float sample_gaussian_slope(float u) {
    return erf_inv(clamp(2 * u - 1, -kOneMinusEpsilon, kOneMinusEpsilon));
}

/// Slope along the direction of view, for unit roughness and a view at angle θ. Its density is
/// proportional to max(0, cos θ − x sin θ) exp(−x²), so that with b = erf(x) the cumulative
/// distribution is
///     C(b) = (1 + b) cos θ + sin θ exp(−x²)/√π,   dC/db = cos θ − x sin θ,  b in [−1, erf(cot θ)].
/// C is concave in b, so Newton's method, kept within a bracket, converges from the left [Jakob 2014].
float sample_visible_slope(float cos_theta, float sin_theta, float u) {
    constexpr float kInvSqrtPi = 0.56418958354775628695f;
    const auto C = [&](float b, float x) {
        return (1 + b) * cos_theta + sin_theta * kInvSqrtPi * std::exp(-x * x);
    };
    const float cot = cos_theta / sin_theta;
    const float b_max = std::min(std::erf(cot), kOneMinusEpsilon);
    const float c_max = C(b_max, cot), target = u * c_max, tolerance = 1e-6f * c_max;

    float lo = -kOneMinusEpsilon, hi = b_max;
    float b = std::max(lo, u * (1 + b_max) - 1);
    float x = erf_inv(b);
    for (int i = 0; i < 20; ++i) {
        const float error = C(b, x) - target;
        if (std::fabs(error) < tolerance) break;
        (error > 0 ? hi : lo) = b;
        const float step = b - error / (cos_theta - x * sin_theta);
        b = step > lo && step < hi ? step : 0.5f * (lo + hi);
        x = erf_inv(b);
    }
    return x;
}

Vec3 sample_visible_beckmann(Vec3 w_std, Vec2 u) {
    const float sin_theta = std::sqrt(sqr(w_std.x) + sqr(w_std.y));
    const float y = sample_gaussian_slope(u.y);
    // Nothing is hidden at normal incidence.
    if (sin_theta < 1e-4f) return {-sample_gaussian_slope(u.x), -y, 1};
    const float x = sample_visible_slope(w_std.z, sin_theta, u.x);
    const float cos_phi = w_std.x / sin_theta, sin_phi = w_std.y / sin_theta;
    return {-(cos_phi * x - sin_phi * y), -(sin_phi * x + cos_phi * y), 1};
}

Vec3 sample_visible_ggx(Vec3 w_std, Vec2 u) {
    // The cap of directions that mirror w into itself: z uniform in (−w.z, 1].
    const float z = (1 - u.y) * (1 + w_std.z) - w_std.z;
    const float r = safe_sqrt((1 - z) * (1 + z));
    float s, c;
    sincosf(2 * kPi * u.x, &s, &c);
    return Vec3{r * c, r * s, z} + w_std;
}

}  // namespace

namespace {

constexpr float kAcosSlack = 1e-3f;

}  // namespace

HalfwayBound halfway_of_reflection(Vec3 wo, const DirectionCone& c) {
    HalfwayBound bound;
    if (wo.z < 0) return halfway_of_reflection(-wo, {-c.axis, c.angle});
    const Vec3 h = wo + c.axis;
    const float length_h = length(h);
    if (!(length_h > 1e-3f)) return bound;
    const float cos_d =
        std::cos(std::acos(clamp(0.5f * length_h, 0.0f, 1.0f)) + 0.5f * c.angle + kAcosSlack);
    if (!(cos_d > 0)) return bound;
    bound.theta =
        std::acos(clamp(h.z / length_h, -1.0f, 1.0f)) - c.angle / (2 * cos_d) - kAcosSlack;
    bound.cos_d = cos_d;
    return bound;
}

HalfwayBound halfway_of_refraction(Vec3 wo, const DirectionCone& c, float eta) {
    HalfwayBound bound;
    const Vec3 h = wo + c.axis * eta;
    const float length_h = length(h), spread = 2 * eta * std::sin(0.5f * c.angle);
    bound.length = std::fmax(std::fabs(eta - 1), length_h - spread);
    if (spread < length_h)
        bound.theta = std::acos(clamp(std::fabs(h.z) / length_h, 0.0f, 1.0f)) -
                      std::asin(spread / length_h) - kAcosSlack;
    return bound;
}

float Microfacet::max_D(float theta) const {
    if (theta >= 0.5f * kPi) return 0;
    // Of a peaked distribution, sin²θ decides; 1 - cos²θ would have lost its digits.
    const float sin2 = theta > 0 ? sqr(std::sin(theta)) : 0.0f, cos2 = 1 - sin2;
    const float max_alpha2 = sqr(std::fmax(alpha_x_, alpha_y_)), norm = kPi * alpha_x_ * alpha_y_;
    if (kind_ == Kind::Ggx) {
        // It falls with θ for α ≤ 1; beyond that the peak lies at the horizon.
        return max_alpha2 > 1 ? sqr(max_alpha2) / norm : 1 / (norm * sqr(cos2 + sin2 / max_alpha2));
    }
    // exp(-tan²θ/α²)/cos⁴θ has its maximum at tan²θ = 2α² - 1.
    const float tan2 = std::fmax(sin2 / cos2, 2 * max_alpha2 - 1);
    return std::exp(-tan2 / max_alpha2) * sqr(1 + tan2) / norm;
}

float Microfacet::max_pdf_of_refraction(Vec3 wo, const DirectionCone& c, float eta) const {
    const HalfwayBound h = halfway_of_refraction(wo, c, eta);
    return max_D(h.theta) * sqr(eta / h.length) / sigma(wo);
}

Vec3 Microfacet::sample_visible(Vec3 w, Vec2 u) const {
    // The configuration is stretched to unit roughness; normals are transformed back by the inverse transpose.
    const Vec3 w_std = normalize({alpha_x_ * w.x, alpha_y_ * w.y, w.z});
    const Vec3 m =
        kind_ == Kind::Ggx ? sample_visible_ggx(w_std, u) : sample_visible_beckmann(w_std, u);
    return normalize({alpha_x_ * m.x, alpha_y_ * m.y, std::max(1e-7f, m.z)});
}

}  // namespace etendue
