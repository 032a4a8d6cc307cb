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

/// An end of a ray: a point of a surface, or a free point, whose normal is zero.
struct RayEnd {
    Vec3 p;
    Vec3 ng{};        ///< Unit geometric normal.
    float slack = 0;  ///< As SurfaceGeometry::slack.
};

/// Moves a ray's origin off its surface, along the geometric normal to the side of `d`, by a distance that exceeds the
/// rounding of the origin's coordinates and the slack of the surface [after Wächter & Binder 2019]. The distance does not
/// depend on the size of the scene.
inline Vec3 offset_origin(const RayEnd& from, Vec3 d) {
    constexpr float kRounding = 0x1p-21f;
    const float offset = std::max(largest_coordinate(from.p) * kRounding, from.slack);
    return from.p + from.ng * std::copysign(offset, dot(from.ng, d));
}

}  // namespace etendue
