#pragma once
// Fixed-radius search among points: a hashed grid, built by counting sort.

#include <algorithm>
#include <array>
#include <bit>
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

/// The part of a ball within `half_height` of the plane through its centre with normal `n`.
struct FlatBall {
    Vec3 p;
    float radius;
    Vec3 n{};
    float half_height = kInf;
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

    /// Cells have the width 2·radius, so that a query of this radius looks into eight of them. The order of the entries
    /// determines that of the results.
    void build(std::span<const Entry> entries, float radius);
    const CellHash& cells() const { return cells_; }
    CellCounts counts() const;
    bool is_empty() const { return entries_.empty(); }

    /// Calls use(entry) for every point nearer to `p` than `radius`.
    template <class Use>
    void for_each_near(Vec3 p, float radius, const Use& use) const {
        for_each_in(FlatBall{p, radius}, use);
    }
    /// Calls use(entry) for every point in `region`, and maybe for others within a thousandth of its height from it.
    template <class Use>
    void for_each_in(const FlatBall& region, const Use& use) const {
        if (entries_.empty()) return;
        // Several buckets are looked up together, because memory latency dominates the time.
        constexpr int kBatch = 8;
        CellHash::Cell cells[kBatch];
        uint32_t begin[kBatch], end[kBatch];
        int count = 0;
        const auto test_batch = [&] {
            for (int i = 0; i < count; ++i) {
                const uint32_t bucket = begin[i];
                begin[i] = begins_[bucket], end[i] = begins_[bucket + 1];
                if (begin[i] == end[i]) continue;
                __builtin_prefetch(&blocks_[begin[i] / kBlock]);
                __builtin_prefetch(&entries_[begin[i]]);
            }
            for (int i = 0; i < count; ++i)
                for_each_in(begin[i], end[i], region, [&](const Entry& e) {
                    // Other cells may share the bucket.
                    if (cells_.cell_of(e.p) == cells[i]) use(e);
                });
            count = 0;
        };
        cells_.for_each_near(region.p, region.radius, [&](const CellHash::Cell& cell) {
            cells[count] = cell;
            begin[count] = cells_.bucket_of(cell);
            __builtin_prefetch(&begins_[begin[count]]);
            if (++count == kBatch) test_batch();
        });
        test_batch();
    }
    /// Number of entries that for_each_near() tests.
    size_t candidates(Vec3 p, float radius) const;
    size_t memory_bytes() const {
        return entries_.capacity() * sizeof(Entry) + blocks_.capacity() * sizeof(Block) +
               begins_.capacity() * sizeof(uint32_t);
    }

private:
    /// Positions of consecutive entries, for tests of several at a time.
    static constexpr uint32_t kBlock = 8;
    using Lanes [[gnu::vector_size(kBlock * sizeof(float))]] = float;
    using Bits [[gnu::vector_size(kBlock * sizeof(float))]] = int32_t;
    struct Block {
        Lanes x, y, z;
    };

    /// The same for the entries from `begin` to `end`.
    template <class Use>
    void for_each_in(uint32_t begin, uint32_t end, const FlatBall& region, const Use& use) const {
        const auto& [p, radius, n, half_height] = region;
        const float radius2 = radius * radius, height = 1.001f * half_height;
        for (uint32_t first = begin; first < end;) {
            const uint32_t of_block = first / kBlock * kBlock;
            const uint32_t last = std::min(end, of_block + kBlock);
            const Block& b = blocks_[of_block / kBlock];
            const Lanes x = b.x - p.x, y = b.y - p.y, z = b.z - p.z;
            const Lanes along = x * n.x + y * n.y + z * n.z;
            const Bits bits = (x * x + y * y + z * z < radius2) & (along <= height) &
                              (along >= -height) & Bits{1, 2, 4, 8, 16, 32, 64, 128};
            uint32_t near = 0;
            for (uint32_t i = 0; i < kBlock; ++i) near |= uint32_t(bits[i]);
            near &= (1u << (last - of_block)) - (1u << (first - of_block));
            for (; near != 0; near &= near - 1)
                use(entries_[of_block + uint32_t(std::countr_zero(near))]);
            first = last;
        }
    }

    CellHash cells_;
    std::vector<Entry> entries_;    ///< Sorted by bucket.
    std::vector<Block> blocks_;     ///< The positions of `entries_`.
    std::vector<uint32_t> begins_;  ///< First entry of each bucket, and the number of entries.
};

}  // namespace etendue
