#include "reuse/gather_roulette.h"

#include <cmath>

#include "reuse/gather_constants.h"

namespace etendue {
namespace {

/// Fixed-point unit of the sums of squares.
constexpr double kUnit = 0x1p24;

}  // namespace

void GatherRoulette::learn(const GatherTotals& totals) {
    // Prior: kJoins joins with the ratio kFirst.
    constexpr double kFirst = 0.125, kJoins = 16;
    search_factors_.fill(0);
    for (size_t i = 0; i < factors_.size(); ++i) {
        const GatherTotals::Joins& joins = totals.joins[i];
        const float rms = float(
            std::sqrt((joins.squares / kUnit + kJoins * sqr(kFirst)) / (joins.count + kJoins)));
        factors_[i] = kGatherConstants.pair_survival * rms;
        float& search = search_factors_[i % kGatherLengths];
        search = std::max(search, kGatherConstants.search_survival * rms);
    }
}

void GatherRoulette::observe(int s, int t, float ratio, GatherSums& sums) {
    // Limits the influence of single joins that contribute much more than estimated.
    constexpr float kMost = 8;
    GatherSums::Joins& joins = sums.joins[index(s, t)];
    ++joins.count;
    if (ratio > 0) joins.squares += uint64_t(kUnit * sqr(double(std::min(ratio, kMost))));
}

}  // namespace etendue
