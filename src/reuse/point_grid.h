#pragma once
// Fixed-radius search among points: a hashed grid, built by counting sort.

#include <span>
#include <vector>

#include "pathspace/learned_state.h"
#include "reuse/cell_hash.h"

namespace etendue {

/// Number of points in each cell, or in all cells that share its bucket.
struct CellCounts {
    CellHash cells;
    std::vector<uint32_t> counts;  ///< By bucket; empty if nothing is known.

    void save(LearnedState& to) const {
        to.put(cells);
        to.put(counts);
    }
    void load(LearnedState& from) {
        from.get(cells);
        from.get(counts);
    }
};

class PointGrid {
public:
    /// A point, the caller's index for it, and data that the caller needs without a look-up.
    struct Entry {
        Vec3 p;
        uint32_t index;
        uint32_t tag = 0;
        float weight = 0;
    };

    /// For queries of up to `radius`. The order of the entries determines that of the results.
    void build(std::span<const Entry> entries, float radius);
    const CellHash& cells() const { return cells_; }
    CellCounts counts() const;
    bool is_empty() const { return entries_.empty(); }

    /// Calls use(entry) for every point nearer to `p` than `radius`, at most that of build().
    template <class Use>
    void for_each_near(Vec3 p, float radius, const Use& use) const {
        if (entries_.empty()) return;
        const CellHash::Cell lowest = cells_.lowest_cell(p);
        const float radius2 = radius * radius;
        // All eight buckets are looked up together, because memory latency dominates the time.
        CellHash::Cell cells[8];
        uint32_t begin[8], end[8];
        for (int corner = 0; corner < 8; ++corner) {
            cells[corner] = lowest.neighbour(corner);
            begin[corner] = cells_.bucket_of(cells[corner]);
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
                if (length2(e.p - p) < radius2 && cells_.cell_of(e.p) == cells[corner]) use(e);
            }
    }
    /// Number of entries that for_each_near() tests.
    size_t candidates(Vec3 p) const;
    size_t memory_bytes() const {
        return entries_.capacity() * sizeof(Entry) + begins_.capacity() * sizeof(uint32_t);
    }

private:
    CellHash cells_;
    std::vector<Entry> entries_;    ///< Sorted by bucket.
    std::vector<uint32_t> begins_;  ///< First entry of each bucket, and the number of entries.
};

}  // namespace etendue
