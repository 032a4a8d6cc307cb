#pragma once
// The plane of a triangle.

#include <cmath>
#include <limits>

#include "math/vec.h"

namespace etendue {

/// Cross product of the edges from `a` to `b` and to `c`. Products of floats are exact in double and cannot overflow, so
/// exactly parallel edges give exactly zero, with or without fused multiply-add.
struct EdgeProduct {
    double x, y, z;
    double length;  ///< Twice the area of the triangle.

    EdgeProduct(Vec3 a, Vec3 b, Vec3 c) {
        const Vec3 e1 = b - a, e2 = c - a;
        const double ax = e1.x, ay = e1.y, az = e1.z, bx = e2.x, by = e2.y, bz = e2.z;
        x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
        length = std::sqrt(x * x + y * y + z * z);
    }
    /// Whether the area has a reciprocal in single precision. What is too large is not asked here.
    bool has_area() const { return !(length < 4 * double(std::numeric_limits<float>::min())); }
    /// The unit normal; defined where the triangle has an area.
    Vec3 normal() const { return {float(x / length), float(y / length), float(z / length)}; }
};

}  // namespace etendue
