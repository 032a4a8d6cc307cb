#include "reuse/pair_density.h"

#include <tbb/parallel_for.h>

#include "reuse/point_grid.h"

namespace etendue {

PairDensity::PairDensity(const PointGrid& vertices, float radius, double correlation)
    : cells_(vertices.cells()), levels_(cells_.buckets()), correlation_(correlation) {
    // Ratio of the area of a disc to that of a cell's face: a plane through the cell has about that area in it.
    const double scale = correlation * double(kPi) * sqr(double(radius / cells_.width()));
    tbb::parallel_for(uint32_t(0), cells_.buckets(), [&](uint32_t bucket) {
        if (const uint32_t n = vertices.points_in(bucket))
            levels_[bucket] = pair_level_of_share(1 / (1 + scale * double(n)));
    });
}

}  // namespace etendue
