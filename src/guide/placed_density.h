#pragma once
// Density of weights on surfaces.

#include <array>
#include <vector>

#include "guide/kd_splits.h"
#include "math/bounds.h"

namespace etendue {

/// A weight at a place on a surface.
struct PlacedWeight {
    Vec3 p, n;  ///< n: normal on the side that is meant.
    float weight = 0;
};

/// Octant of a normal, which tells the sides of a wall apart.
inline size_t octant(Vec3 n) {
    return size_t(n.x < 0) | size_t(n.y < 0) << 1 | size_t(n.z < 0) << 2;
}

/// Weights over area, in boxes of a k-d tree that hold few of them; 0 outside of the boxes. An estimate, not a density to
/// sample from.
class PlacedDensity {
public:
    explicit PlacedDensity(std::vector<PlacedWeight> weights);
    /// Near `p`, of weights with normals in the octant of `n`; per area of the surfaces.
    double operator()(Vec3 p, Vec3 n) const;

private:
    struct Box {
        Bounds3 bounds;
        std::array<double, 8> density{};  ///< By octant.
    };
    void split(uint32_t node, PlacedWeight* begin, PlacedWeight* end);

    KdSplits splits_;  ///< Its leaves are boxes.
    std::vector<Box> boxes_;
};

}  // namespace etendue
