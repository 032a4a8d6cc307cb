#pragma once
// Integer mixing for counter-based random numbers and hash tables.

#include <cstdint>

namespace etendue {

/// Finaliser of SplitMix64 [Steele et al. 2014]: a bijection with full avalanche.
constexpr uint64_t mix64(uint64_t x) {
    x ^= x >> 30;
    x *= 0xbf58476d1ce4e5b9ull;
    x ^= x >> 27;
    x *= 0x94d049bb133111ebull;
    x ^= x >> 31;
    return x;
}
constexpr uint64_t hash_combine(uint64_t a, uint64_t b) {
    return mix64(a + 0x9e3779b97f4a7c15ull * (b + 1));
}
constexpr uint64_t reverse_bits(uint64_t x) {
    x = __builtin_bswap64(x);
    x = (x & 0x0f0f0f0f0f0f0f0full) << 4 | (x >> 4 & 0x0f0f0f0f0f0f0f0full);
    x = (x & 0x3333333333333333ull) << 2 | (x >> 2 & 0x3333333333333333ull);
    return (x & 0x5555555555555555ull) << 1 | (x >> 1 & 0x5555555555555555ull);
}
constexpr uint32_t reverse_bits(uint32_t x) {
    return uint32_t(reverse_bits(uint64_t{x}) >> 32);
}
/// Uniform in [0, 1) with 53 bits.
constexpr double to_unit_double(uint64_t bits) {
    return double(bits >> 11) * 0x1p-53;
}
/// Uniform in [0, 1) with 24 bits.
constexpr float to_unit_float(uint32_t bits) {
    return float(bits >> 8) * 0x1p-24f;
}

}  // namespace etendue
