#pragma once
// Points that fill an interval or a square evenly: u, shifted by multiples of irrational numbers, modulo 1
// [Kronecker's sequence; Roberts 2018 for the square]. Each of them alone is uniformly distributed if u is.

#include <cmath>
#include <cstdint>

#include "math/vec.h"

namespace etendue {

/// The k-th point; u itself for k = 0. u lies in [0, 1), and so does the result.
inline double rotated(double u, uint32_t k) {
    if (k == 0) return u;
    constexpr double kGolden = 0.6180339887498949;  // 1/φ with φ² = φ + 1
    const double x = u + k * kGolden;
    return x - std::floor(x);
}
inline FinePoint rotated(FinePoint u, uint32_t k) {
    if (k == 0) return u;
    constexpr double kX = 0.7548776662466927, kY = kX * kX;  // 1/φ, 1/φ² with φ³ = φ + 1
    const double x = u.x + k * kX, y = u.y + k * kY;
    return {x - std::floor(x), y - std::floor(y)};
}

}  // namespace etendue
