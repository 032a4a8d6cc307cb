#pragma once
// Maps from the unit square to discs, hemispheres, cones and triangles, each with its density.

#include <algorithm>

#include "math/vec.h"

namespace etendue {

/// sin and cos of (π/4)·t for t in [-1, 1], by their series; errors below 1e-7.
inline void sincos_quarter_pi(float t, float& s, float& c) {
    const float x = (kPi / 4) * t, x2 = x * x;
    s = x * (1 + x2 * (-1.0f / 6 + x2 * (1.0f / 120 + x2 * (-1.0f / 5040 + x2 * (1.0f / 362880)))));
    c = 1 + x2 * (-0.5f + x2 * (1.0f / 24 + x2 * (-1.0f / 720 + x2 * (1.0f / 40320))));
}

/// Uniform on the unit disc, concentric map [Shirley & Chiu 1997].
inline Vec2 sample_uniform_disk(Vec2 u) {
    const float a = 2 * u.x - 1, b = 2 * u.y - 1;
    if (a == 0 && b == 0) return {0, 0};
    // The angle is (π/4) b/a in the left and right quadrants, π/2 - (π/4) a/b above and below.
    const bool upright = b * b >= a * a;
    const float r = upright ? b : a;
    float s, c;
    sincos_quarter_pi((upright ? a : b) / r, s, c);
    return upright ? Vec2{r * s, r * c} : Vec2{r * c, r * s};
}
inline constexpr float kUniformDiskPdf = kInvPi;

/// Density cos θ / π on the upper hemisphere.
inline Vec3 sample_cosine_hemisphere(Vec2 u) {
    const Vec2 d = sample_uniform_disk(u);
    return {d.x, d.y, safe_sqrt(1 - d.x * d.x - d.y * d.y)};
}
inline float pdf_cosine_hemisphere(float cos_theta) {
    return std::max(cos_theta, 0.0f) * kInvPi;
}

inline Vec3 sample_uniform_sphere(Vec2 u) {
    const float z = 1 - 2 * u.x;
    const float r = safe_sqrt(1 - z * z);
    float s, c;
    sincosf(2 * kPi * u.y, &s, &c);
    return {r * c, r * s, z};
}
inline constexpr float kUniformSpherePdf = kInvPi / 4;

/// Uniform in solid angle within the cone about +z whose half-angle has the versine `most`, 1 - cos θ: for narrow cones,
/// it keeps the digits that cos θ loses.
inline Vec3 sample_uniform_cone(Vec2 u, float most) {
    const float versine = u.x * most;
    const float r = safe_sqrt(versine * (2 - versine));
    float s, c;
    sincosf(2 * kPi * u.y, &s, &c);
    return {r * c, r * s, 1 - versine};
}
inline float pdf_uniform_cone(float most) {
    return kInvPi / (2 * most);
}
/// 1 - cos of the angle between two unit vectors.
inline float versine(Vec3 a, Vec3 b) {
    return 0.5f * length2(a - b);
}

/// Barycentric coordinates of the second and third vertex, uniform in area.
inline Vec2 sample_uniform_triangle(Vec2 u) {
    const float r = std::sqrt(u.x);
    return {1 - r, u.y * r};
}

}  // namespace etendue
