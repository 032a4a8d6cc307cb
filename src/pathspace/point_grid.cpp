#include "pathspace/point_grid.h"

#include <algorithm>
#include <bit>

namespace etendue {

void PointGrid::build(std::span<const Entry> entries, float radius) {
    inv_cell_ = 0.5f / radius;
    const size_t buckets = std::bit_ceil(std::max<size_t>(entries.size(), 1));
    mask_ = uint32_t(buckets - 1);
    begins_.assign(buckets + 1, 0);
    std::vector<uint32_t> bucket(entries.size());
    for (size_t i = 0; i < entries.size(); ++i)
        ++begins_[(bucket[i] = bucket_of(cell_of(entries[i].p))) + 1];
    for (size_t b = 0; b < buckets; ++b) begins_[b + 1] += begins_[b];
    entries_.resize(entries.size());
    std::vector<uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (size_t i = 0; i < entries.size(); ++i) entries_[next[bucket[i]]++] = entries[i];
}

size_t PointGrid::candidates(Vec3 p) const {
    if (entries_.empty()) return 0;
    const Cell lowest = lowest_cell(p);
    size_t count = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const uint32_t bucket = bucket_of(lowest.neighbour(corner));
        count += begins_[bucket + 1] - begins_[bucket];
    }
    return count;
}

}  // namespace etendue
