#include "reuse/point_grid.h"

#include <algorithm>

#include "film/parallel_for.h"
#include "film/thread_arena.h"

namespace etendue {

void PointGrid::build(std::span<const Entry> entries, float radius) {
    cells_ = CellHash(entries.size(), radius);
    const uint32_t buckets = cells_.buckets();
    std::vector<uint32_t> bucket(entries.size());
    parallel_for(entries.size(),
                 [&](size_t i) { bucket[i] = cells_.bucket_of(cells_.cell_of(entries[i].p)); });
    // Each part fills some of the buckets and reads all entries in order, so that the result does not depend on the
    // number of parts.
    const uint32_t parts = uint32_t(std::clamp(ThreadArena::threads_here(), 1, 8));
    const auto for_each_part = [&](const auto& use) {
        parallel_for(parts, [&](uint32_t part) {
            const auto bound = [&](uint32_t i) { return uint32_t(uint64_t(buckets) * i / parts); };
            const uint32_t begin = bound(part), end = bound(part + 1);
            for (size_t i = 0; i < bucket.size(); ++i)
                if (bucket[i] - begin < end - begin) use(i);
        });
    };
    begins_.assign(size_t(buckets) + 1, 0);
    for_each_part([&](size_t i) { ++begins_[bucket[i] + 1]; });
    for (size_t b = 0; b < buckets; ++b) begins_[b + 1] += begins_[b];
    entries_.resize(entries.size());
    std::vector<uint32_t> next(begins_.begin(), begins_.end() - 1);
    for_each_part([&](size_t i) { entries_[next[bucket[i]]++] = entries[i]; });
    blocks_.resize((entries_.size() + kBlock - 1) / kBlock);
    // By block, since the lanes of a vector are one object, which only one thread may write.
    parallel_for(blocks_.size(), [&](size_t block) {
        Block b{};
        const size_t first = block * kBlock, end = std::min(first + kBlock, entries_.size());
        for (size_t i = first; i < end; ++i) {
            b.x[i - first] = entries_[i].p.x;
            b.y[i - first] = entries_[i].p.y;
            b.z[i - first] = entries_[i].p.z;
        }
        blocks_[block] = b;
    });
}

CellCounts PointGrid::counts() const {
    CellCounts c{cells_, std::vector<uint32_t>(begins_.empty() ? 0 : cells_.buckets())};
    for (size_t i = 0; i < c.counts.size(); ++i) c.counts[i] = begins_[i + 1] - begins_[i];
    return c;
}

size_t PointGrid::candidates(Vec3 p, float radius) const {
    if (entries_.empty()) return 0;
    size_t count = 0;
    cells_.for_each_near(p, radius, [&](const CellHash::Cell& cell) {
        const uint32_t bucket = cells_.bucket_of(cell);
        count += begins_[bucket + 1] - begins_[bucket];
    });
    return count;
}

}  // namespace etendue
