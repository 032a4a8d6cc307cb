#pragma once
// Points within a distance of another, and how many lie about it: a hashed grid, built by counting.

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "math/hash.h"
#include "math/vec.h"

namespace etendue {

/// Cubes of space in hashed buckets, and the numbers of points in these.
class HashedCells {
public:
    struct Cell {
        int x, y, z;
        friend bool operator==(const Cell&, const Cell&) = default;
        /// One of the eight that share the upper corner of this one.
        Cell neighbour(int corner) const {
            return {x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)};
        }
    };
    /// For `points`; wide enough that a ball of `radius` meets at most eight.
    HashedCells(size_t points = 0, float radius = 1);

    float width() const { return 1 / inv_width_; }
    /// Of those that a ball meets.
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
    /// Points in the bucket of the cell of `p`, those of other cells included.
    uint32_t points_about(Vec3 p) const {
        if (begins_.empty()) return 0;
        const uint32_t bucket = bucket_of(cell_of(p));
        return begins_[bucket + 1] - begins_[bucket];
    }

private:
    friend class PointGrid;

    float inv_width_;
    uint32_t mask_;
    /// Of each bucket in the list of all points; one more than there are. Filled by PointGrid.
    std::vector<uint32_t> begins_;
};

class PointGrid {
public:
    /// A point, the caller's number for it, and what the caller wants to know of it before looking that up.
    struct Entry {
        Vec3 p;
        uint32_t index;
        uint32_t tag = 0;
        float weight = 0;
    };

    /// For queries of up to `radius`. The order of the entries decides that of the answers.
    void build(std::span<const Entry> entries, float radius);
    /// The numbers of points, without the points: nothing is found until the next build().
    HashedCells take_cells();

    /// Calls use(entry) for every point nearer to `p` than `radius`, at most that of build().
    template <class Use>
    void for_each_near(Vec3 p, float radius, const Use& use) const {
        if (entries_.empty()) return;
        const HashedCells::Cell lowest = cells_.lowest_cell(p);
        const std::vector<uint32_t>& begins = cells_.begins_;
        const float radius2 = radius * radius;
        // All eight at a time, since what takes the time is waiting for memory.
        HashedCells::Cell cells[8];
        uint32_t begin[8], end[8];
        for (int corner = 0; corner < 8; ++corner) {
            cells[corner] = lowest.neighbour(corner);
            begin[corner] = cells_.bucket_of(cells[corner]);
            __builtin_prefetch(&begins[begin[corner]]);
        }
        for (int corner = 0; corner < 8; ++corner) {
            const uint32_t bucket = begin[corner];
            begin[corner] = begins[bucket], end[corner] = begins[bucket + 1];
            if (begin[corner] < end[corner]) __builtin_prefetch(&entries_[begin[corner]]);
        }
        for (int corner = 0; corner < 8; ++corner)
            for (uint32_t i = begin[corner]; i < end[corner]; ++i) {
                const Entry& e = entries_[i];
                // Other cells may share the bucket.
                if (length2(e.p - p) < radius2 && cells_.cell_of(e.p) == cells[corner]) use(e);
            }
    }
    /// Entries that for_each_near() looks at.
    size_t candidates(Vec3 p) const;
    size_t memory_bytes() const {
        return entries_.capacity() * sizeof(Entry) + cells_.begins_.capacity() * sizeof(uint32_t);
    }

private:
    HashedCells cells_;
    std::vector<Entry> entries_;  ///< Sorted by bucket.
};

}  // namespace etendue
