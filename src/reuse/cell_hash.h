#pragma once
// Hashing of cubic cells of space into buckets.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "math/hash.h"
#include "math/vec.h"

namespace etendue {

class CellHash {
public:
    struct Cell {
        int x, y, z;
        friend bool operator==(const Cell&, const Cell&) = default;
    };
    /// Has about twice as many buckets as `points`, and cells of width 2·radius, so that a ball of `radius` meets eight
    /// cells. The width is limited, so that its inverse is finite.
    constexpr CellHash(size_t points = 0, float radius = 1)
        : inv_width_(0.5f / std::max(radius, 1e-30f)),
          mask_(uint32_t(std::bit_ceil(std::clamp<size_t>(2 * points, 1, size_t(1) << 31)) - 1)) {}

    float width() const { return 1 / inv_width_; }
    uint32_t buckets() const { return mask_ + 1; }
    Cell cell_of(Vec3 p) const { return cell_of_scaled(p * inv_width_); }
    /// Calls use(cell) for each cell that a ball of `radius` about `p` may meet: x varies fastest, then y.
    template <class Use>
    void for_each_near(Vec3 p, float radius, const Use& use) const {
        constexpr float kRounding = 1.00001f;
        const float r = radius * inv_width_ * kRounding;
        const Vec3 s = p * inv_width_;
        const Cell low = cell_of_scaled(s - Vec3{r, r, r}),
                   high = cell_of_scaled(s + Vec3{r, r, r});
        for (int z = low.z; z <= high.z; ++z)
            for (int y = low.y; y <= high.y; ++y)
                for (int x = low.x; x <= high.x; ++x) use(Cell{x, y, z});
    }
    /// Cells of a block of 4×4×4 have consecutive buckets, so that cells near each other share cache lines.
    uint32_t bucket_of(const Cell& c) const {
        const uint64_t key = uint64_t(uint32_t(c.x >> 2)) * 0x9e3779b97f4a7c15ull ^
                             uint64_t(uint32_t(c.y >> 2)) * 0xc2b2ae3d27d4eb4full ^
                             uint64_t(uint32_t(c.z >> 2)) * 0x165667b19e3779f9ull;
        const uint32_t in_block =
            uint32_t(c.x & 3) | uint32_t(c.y & 3) << 2 | uint32_t(c.z & 3) << 4;
        return (uint32_t(mix64(key)) << 6 | in_block) & mask_;
    }

private:
    /// Beyond 2^30 the distance between numbers is that of many cells, and the outermost one takes what lies there.
    static Cell cell_of_scaled(Vec3 s) {
        constexpr float kMost = 0x1p30f;
        const auto cell = [](float x) { return int(clamp(std::floor(x), -kMost, kMost)); };
        return {cell(s.x), cell(s.y), cell(s.z)};
    }

    float inv_width_;
    uint32_t mask_;
};

}  // namespace etendue
