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
        /// One of the eight cells that share the upper corner of this cell, itself included.
        Cell neighbour(int corner) const {
            return {x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)};
        }
    };
    /// Has about twice as many buckets as `points`, and cells of width 2·radius, so that a ball of `radius` meets at
    /// most eight cells.
    CellHash(size_t points = 0, float radius = 1)
        : inv_width_(0.5f / radius),
          mask_(uint32_t(std::bit_ceil(std::clamp<size_t>(2 * points, 1, size_t(1) << 31)) - 1)) {}

    float width() const { return 1 / inv_width_; }
    uint32_t buckets() const { return mask_ + 1; }
    /// The lowest of the eight cells that a ball about `p` can meet.
    Cell lowest_cell(Vec3 p) const {
        const Vec3 s = p * inv_width_;
        return {int(std::floor(s.x - 0.5f)), int(std::floor(s.y - 0.5f)),
                int(std::floor(s.z - 0.5f))};
    }
    Cell cell_of(Vec3 p) const {
        const Vec3 s = p * inv_width_;
        return {int(std::floor(s.x)), int(std::floor(s.y)), int(std::floor(s.z))};
    }
    uint32_t bucket_of(const Cell& c) const {
        const uint64_t key = uint64_t(uint32_t(c.x)) * 0x9e3779b97f4a7c15ull ^
                             uint64_t(uint32_t(c.y)) * 0xc2b2ae3d27d4eb4full ^
                             uint64_t(uint32_t(c.z)) * 0x165667b19e3779f9ull;
        return uint32_t(mix64(key)) & mask_;
    }

private:
    float inv_width_;
    uint32_t mask_;
};

}  // namespace etendue
