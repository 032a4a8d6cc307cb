#include "texture/noise.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "math/hash.h"

namespace etendue {
namespace {

constexpr int kPeriod = 256;

/// A random permutation of 0 … 255.
constexpr std::array<uint8_t, kPeriod> kPermutation = [] {
    std::array<uint8_t, kPeriod> table{};
    for (int i = 0; i < kPeriod; ++i) table[size_t(i)] = uint8_t(i);
    for (uint64_t i = kPeriod - 1; i > 0; --i) {
        const uint64_t j = hash_combine(1, i) % (i + 1);
        const uint8_t kept = table[i];
        table[i] = table[j];
        table[j] = kept;
    }
    return table;
}();

int permuted(int i) {
    return kPermutation[size_t(i & (kPeriod - 1))];
}

/// Product of the offset from a lattice point and the point's gradient: one of the 12 directions to the edges of a cube,
/// four of them twice.
template <class V>
auto corner(int x, int y, int z, V offset) {
    const int h = permuted(permuted(permuted(x) + y) + z) & 15;
    const auto u = h < 8 || h == 12 || h == 13 ? offset.x : offset.y;
    const auto v = h < 4 || h == 12 || h == 13 ? offset.y : offset.z;
    return ((h & 1) != 0 ? -u : u) + ((h & 2) != 0 ? -v : v);
}

/// Splits a coordinate into the cell of its period and the position within it.
template <class T>
std::pair<int, T> split(T x) {
    using std::floor;
    const T whole = floor(x), cell = whole - kPeriod * floor(whole / kPeriod);
    // False where x is so large that its cell is not known.
    const bool known = !(cell < 0) && cell < kPeriod;
    return known ? std::pair(int(cell), x - whole) : std::pair(0, T(0));
}

template <class T>
T fade(T t) {
    return t * t * t * (t * (6 * t - 15) + 10);
}

template <class V>
auto noise_at(V p) {
    using T = decltype(p.x);
    const auto [x, dx] = split(p.x);
    const auto [y, dy] = split(p.y);
    const auto [z, dz] = split(p.z);
    T along_z[2];
    for (int k = 0; k < 2; ++k) {
        T along_y[2];
        for (int j = 0; j < 2; ++j) {
            const V offset{dx, dy - float(j), dz - float(k)};
            along_y[j] = lerp(fade(dx), corner(x, y + j, z + k, offset),
                              corner(x + 1, y + j, z + k, offset - V{1, 0, 0}));
        }
        along_z[k] = lerp(fade(dy), along_y[0], along_y[1]);
    }
    return lerp(fade(dz), along_z[0], along_z[1]);
}

/// Ratio of the frequencies of octaves; not 2, so that their lattices do not coincide.
constexpr float kLacunarity = 1.99f;

template <class V, class F>
auto sum_octaves(V p, float omega, int octaves, const F& f) {
    decltype(p.x) sum = 0;
    float weight = 1;
    for (int i = 0; i < octaves; ++i) {
        sum = sum + weight * f(noise_at(p));
        p = p * kLacunarity;
        weight *= omega;
    }
    return sum;
}

template <class V>
auto fbm_at(V p, float omega, int octaves) {
    return sum_octaves(p, omega, octaves, [](auto x) { return x; });
}

template <class V>
auto turbulence_at(V p, float omega, int octaves) {
    using std::fabs;
    return sum_octaves(p, omega, octaves, [](auto x) { return fabs(x); }) +
           0.2f * float(std::pow(omega, octaves));
}

}  // namespace

float noise(Vec3 p) {
    return noise_at(p);
}

float fbm(Vec3 p, float omega, int octaves) {
    return fbm_at(p, omega, octaves);
}
Dual fbm(Vec3Dual p, float omega, int octaves) {
    return fbm_at(p, omega, octaves);
}

float turbulence(Vec3 p, float omega, int octaves) {
    return turbulence_at(p, omega, octaves);
}
Dual turbulence(Vec3Dual p, float omega, int octaves) {
    return turbulence_at(p, omega, octaves);
}

}  // namespace etendue
