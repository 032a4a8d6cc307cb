#pragma once
// Points within a distance of another: a hashed grid, built by counting.

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "math/hash.h"
#include "math/vec.h"

namespace etendue {

class PointGrid {
public:
    /// A point, the caller's number for it, and what the caller wants to know of it before looking that up.
    struct Entry {
        Vec3 p;
        uint32_t index;
        uint32_t tag = 0;
    };

    /// For queries of up to `radius`. The order of the entries decides that of the answers.
    void build(std::span<const Entry> entries, float radius);

    /// Calls use(entry) for every point nearer to `p` than `radius`, at most that of build().
    template <class Use>
    void for_each_near(Vec3 p, float radius, const Use& use) const {
        if (entries_.empty()) return;
        const Cell lowest = lowest_cell(p);
        const float radius2 = radius * radius;
        // All eight at a time, since what takes the time is waiting for memory.
        Cell cells[8];
        uint32_t begin[8], end[8];
        for (int corner = 0; corner < 8; ++corner) {
            cells[corner] = lowest.neighbour(corner);
            begin[corner] = bucket_of(cells[corner]);
            __builtin_prefetch(&begins_[begin[corner]]);
        }
        for (int corner = 0; corner < 8; ++corner) {
            const uint32_t bucket = begin[corner];
            begin[corner] = begins_[bucket], end[corner] = begins_[bucket + 1];
            if (begin[corner] < end[corner]) __builtin_prefetch(&entries_[begin[corner]]);
        }
        for (int corner = 0; corner < 8; ++corner)
            for (uint32_t i = begin[corner]; i < end[corner]; ++i) {
                const Entry& e = entries_[i];
                // Other cells may share the bucket.
                if (length2(e.p - p) < radius2 && cell_of(e.p) == cells[corner]) use(e);
            }
    }
    /// Entries that for_each_near() looks at.
    size_t candidates(Vec3 p) const;
    size_t memory_bytes() const {
        return entries_.capacity() * sizeof(Entry) + begins_.capacity() * sizeof(uint32_t);
    }

private:
    struct Cell {
        int x, y, z;
        friend bool operator==(const Cell&, const Cell&) = default;
        /// One of the eight that share the upper corner of this one.
        Cell neighbour(int corner) const {
            return {x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)};
        }
    };
    /// Of those that a ball meets: at most eight, since cells are twice the radius wide.
    Cell lowest_cell(Vec3 p) const {
        const Vec3 s = p * inv_cell_;
        return {int(std::floor(s.x - 0.5f)), int(std::floor(s.y - 0.5f)),
                int(std::floor(s.z - 0.5f))};
    }
    Cell cell_of(Vec3 p) const {
        const Vec3 s = p * inv_cell_;
        return {int(std::floor(s.x)), int(std::floor(s.y)), int(std::floor(s.z))};
    }
    uint32_t bucket_of(const Cell& c) const {
        const uint64_t key = uint64_t(uint32_t(c.x)) * 0x9e3779b97f4a7c15ull ^
                             uint64_t(uint32_t(c.y)) * 0xc2b2ae3d27d4eb4full ^
                             uint64_t(uint32_t(c.z)) * 0x165667b19e3779f9ull;
        return uint32_t(mix64(key)) & mask_;
    }

    float inv_cell_ = 1;
    uint32_t mask_ = 0;
    std::vector<uint32_t> begins_;  ///< Of each bucket; one more than there are.
    std::vector<Entry> entries_;    ///< Sorted by bucket.
};

}  // namespace etendue
