#pragma once
// Gradient noise and its sums, as pbrt's textures of space use them.

#include "math/dual.h"

namespace etendue {

/// Gradient noise [Perlin 2002] of period 256, about in [-1, 1]; zero at points of integer coordinates. The permutation
/// of the lattice is etendue's own.
float noise(Vec3 p);
inline float noise(float x, float y) {
    return noise(Vec3{x, y, 0.5f});
}

/// Fractional Brownian motion: Σ ω^i noise(1.99^i p) over i < octaves.
float fbm(Vec3 p, float omega, int octaves);
Dual fbm(Vec3Dual p, float omega, int octaves);
/// Σ ω^i |noise(1.99^i p)| over i < octaves, and 0.2 ω^octaves for the octaves that are left out, as in pbrt.
float turbulence(Vec3 p, float omega, int octaves);
Dual turbulence(Vec3Dual p, float omega, int octaves);

}  // namespace etendue
