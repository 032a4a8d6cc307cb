#pragma once
// Density of weights on surfaces.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "guide/kd_splits.h"
#include "math/bounds.h"

namespace etendue {

/// A weight at a place on a surface.
struct PlacedWeight {
    /// n: normal on the side that is meant; zero where light passes through the surface.
    Vec3 p, n;
    float weight = 0;
};

/// Classes of normals, which tell the sides of a wall apart: faces of a cube. Their borders are 45° away from axis-parallel
/// walls, so that small deviations of a normal do not matter.
inline constexpr size_t kCubeFaces = 6;
inline size_t cube_face(Vec3 n) {
    const Vec3 a{std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)};
    const int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
    return 2 * size_t(axis) + size_t(n[axis] < 0);
}
/// Sides of surfaces: cube_face(), and one more for both sides of a surface that light passes, with the normal zero.
inline constexpr size_t kSurfaceSides = kCubeFaces + 1;
inline size_t surface_side(Vec3 n) {
    return length2(n) > 0 ? cube_face(n) : kCubeFaces;
}
/// Area of surfaces in a box, about: most are flat, and as large as the largest side of their box.
inline double surface_area(const Bounds3& box) {
    const Vec3 d = box.hi - box.lo;
    return std::max(
        {double(d.x) * double(d.y), double(d.y) * double(d.z), double(d.z) * double(d.x)});
}

/// Weights over area, in boxes of a k-d tree that hold few of them; 0 outside of the boxes. An estimate, not a density to
/// sample from.
class PlacedDensity {
public:
    /// Weights that are not finite count as 0.
    explicit PlacedDensity(std::vector<PlacedWeight> weights);
    /// Near `p`, of weights on the same side (surface_side()) as `n`; per area of the surfaces.
    double operator()(Vec3 p, Vec3 n) const;

private:
    struct Box {
        Bounds3 bounds;
        std::array<double, kSurfaceSides> density{};
    };
    void split(uint32_t node, PlacedWeight* begin, PlacedWeight* end);

    KdSplits splits_;  ///< Its leaves are boxes.
    std::vector<Box> boxes_;
};

}  // namespace etendue
