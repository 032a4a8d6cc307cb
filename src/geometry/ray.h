#pragma once

#include <algorithm>
#include <cstdint>

#include "math/vec.h"

namespace etendue {

struct Ray {
    Vec3 o;
    Vec3 d;  ///< Unit vector, or for a segment the vector to its end, with `tmax` = 1.
    float tmax = kInf;
};

/// Moves a ray's origin off its surface, along the geometric normal to the side of `d`, by a distance that exceeds the
/// rounding error of hit points [after Wächter & Binder 2019]. The error of points near 0 is that of points with a
/// coordinate `least`, since it depends on where the ray came from. Scenes of the given size far from the origin need
/// smaller offsets, just beyond the rounding of the coordinates.
inline Vec3 offset_origin(Vec3 p, Vec3 ng, Vec3 d, float least, float size) {
    constexpr float kRelative = 0x1p-16f, kRounding = 0x1p-21f;
    const float scale = std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z), least});
    const float offset = std::max(std::min(scale, size) * kRelative, scale * kRounding);
    return p + ng * std::copysign(offset, dot(ng, d));
}

}  // namespace etendue
