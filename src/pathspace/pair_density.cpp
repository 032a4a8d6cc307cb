#include "pathspace/pair_density.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "math/hash.h"

namespace etendue {

void PairDensity::build(std::span<const Vec3> points, float radius) {
    inv_cell_ = 0.5f / radius;
    // So many that few cells share a count.
    const size_t size = std::bit_ceil(std::max<size_t>(2 * points.size(), 1));
    mask_ = uint32_t(size - 1);
    counts_.assign(size, 0);
    for (const Vec3& p : points) ++counts_[cell_of(p)];
}

double PairDensity::share(Vec3 p) const {
    if (counts_.empty()) return 1;
    // A disc of the radius over the square that a plane has of a cell.
    constexpr double kDisc = double(kPi) / 4;
    return 1 / (1 + kDisc * counts_[cell_of(p)]);
}

uint32_t PairDensity::cell_of(Vec3 p) const {
    const Vec3 s = p * inv_cell_;
    const auto index = [](float x) { return uint64_t(uint32_t(int(std::floor(x)))); };
    return uint32_t(mix64(index(s.x) * 0x9e3779b97f4a7c15ull ^ index(s.y) * 0xc2b2ae3d27d4eb4full ^
                          index(s.z) * 0x165667b19e3779f9ull)) &
           mask_;
}

}  // namespace etendue
