#pragma once
// Products over the vertices of a path.

#include <array>
#include <cmath>
#include <cstdint>

#include "math/hash.h"

namespace etendue {

/// A product over the vertices of a path. Where a scene is much larger than what its paths see, each vertex has a factor
/// of 10⁸, and fifty of them exceed the range of double.
using PathDensity = long double;
/// The same by colour.
using PathProduct = std::array<PathDensity, 3>;
PathDensity luminance(const PathProduct& f);

/// A hash of all its bits, with the exponents, which exceed those of double. `f` must be finite and not negative.
inline uint64_t hash_of(const PathProduct& f) {
    uint64_t hash = 0;
    for (const PathDensity of_colour : f) {
        int exponent = 0;
        const auto significand = uint64_t(std::ldexp(std::frexp(of_colour, &exponent), 64));
        hash = hash_combine(hash_combine(hash, significand), uint64_t(exponent));
    }
    return hash;
}

}  // namespace etendue
