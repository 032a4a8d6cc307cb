#include "reuse/pair_density.h"

#include <numbers>

#include "film/parallel_for.h"

namespace etendue {

PairDensity::PairDensity(const CellCounts& vertices, float radius, double correlation,
                         double multiple)
    : cells_(vertices.cells), levels_(vertices.counts.size()), correlation_(correlation) {
    // Ratio of the area of a disc to that of a cell's face: a plane through the cell has about that area in it.
    const double scale =
        correlation * multiple * std::numbers::pi * sqr(double(radius / cells_.width()));
    parallel_for(levels_.size(), [&](size_t bucket) {
        if (const uint32_t n = vertices.counts[bucket])
            levels_[bucket] = pair_level_of_share(1 / (1 + scale * double(n)));
    });
}

}  // namespace etendue
