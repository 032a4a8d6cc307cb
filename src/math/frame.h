#pragma once
// Orthonormal frames and the local shading coordinates (z = normal) that every BSDF works in.

#include "math/vec.h"

namespace etendue {

/// A frame of vectors of type `V`.
template <class V>
struct FrameOf {
    V s{1, 0, 0}, t{0, 1, 0}, n{0, 0, 1};

    /// Any right-handed frame about the unit vector `n` [Duff et al. 2017].
    static FrameOf from_normal(V n) {
        using std::copysign;
        const auto sign = copysign(1.0f, n.z);
        const auto a = -1.0f / (sign + n.z), b = n.x * n.y * a;
        return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x},
                {b, sign + n.y * n.y * a, -n.y},
                n};
    }

    /// Frame about `n` whose `s` is the part of `dpdu` in the tangent plane; any frame where `dpdu` is parallel to `n`.
    static FrameOf from_normal_and_tangent(V n, V dpdu) {
        using std::sqrt;
        const V s = dpdu - n * dot(n, dpdu);
        const auto len2 = length2(s);
        // Closer than 1e-3 radians to n, cancellation leaves too little of s.
        if (!(len2 > 1e-6f * length2(dpdu)) || !(len2 > 0)) return from_normal(n);
        const V unit = s * (1.0f / sqrt(len2));
        return {unit, cross(n, unit), n};
    }

    V to_local(V v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
    V to_world(V v) const { return s * v.x + t * v.y + n * v.z; }
    /// The frame with n and t reversed, so that it stays right-handed.
    FrameOf flipped() const { return {s, -t, -n}; }
};
using Frame = FrameOf<Vec3>;

inline float cos_theta(Vec3 w) {
    return w.z;
}
inline float abs_cos_theta(Vec3 w) {
    return std::fabs(w.z);
}
constexpr float cos2_theta(Vec3 w) {
    return w.z * w.z;
}
inline float sin2_theta(Vec3 w) {
    return std::max(0.0f, 1.0f - w.z * w.z);
}
inline float tan2_theta(Vec3 w) {
    return sin2_theta(w) / cos2_theta(w);
}
constexpr bool same_hemisphere(Vec3 a, Vec3 b) {
    return a.z * b.z > 0;
}
/// Mirror direction about the local normal.
constexpr Vec3 reflect(Vec3 w) {
    return {-w.x, -w.y, w.z};
}
/// Mirror direction about the unit vector `m`.
template <class V>
constexpr V reflect(V w, V m) {
    return m * (2.0f * dot(w, m)) - w;
}

}  // namespace etendue
