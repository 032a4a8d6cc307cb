#include "pathspace/pair_density.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "pathspace/point_grid.h"

namespace etendue {
namespace {

/// Of the levels: a sixteenth of an octave.
constexpr double kLevelsPerOctave = 16;

}  // namespace

PairDensity::PairDensity() {
    for (size_t level = 0; level < shares_.size(); ++level)
        shares_[level] = float(std::exp2(-double(level) / kLevelsPerOctave));
}

PairDensity::PairDensity(const PointGrid& vertices, float radius) : PairDensity() {
    cells_ = vertices.cells();
    levels_.resize(cells_.buckets());
    // The area of a disc over that of the square that a plane has of a cell.
    const double scale = kCorrelation * double(kPi) * sqr(double(radius / cells_.width()));
    tbb::parallel_for(uint32_t(0), cells_.buckets(), [&](uint32_t bucket) {
        if (const uint32_t n = vertices.points_in(bucket))
            levels_[bucket] = uint8_t(
                std::min(255.0, std::round(kLevelsPerOctave * std::log2(1 + scale * double(n)))));
    });
}

}  // namespace etendue
