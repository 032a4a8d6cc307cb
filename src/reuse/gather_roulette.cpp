#include "reuse/gather_roulette.h"

#include <cmath>

namespace etendue {
namespace {

/// Of the squares, which are summed in whole numbers.
constexpr double kUnit = 0x1p24;

}  // namespace

void GatherRoulette::learn(const GatherTotals& totals) {
    // As if there had been a few joins with the ratio that is first assumed.
    constexpr double kFirst = 0.125, kJoins = 16;
    // By trial on four scenes; a factor of two in either is hardly seen.
    constexpr float kPair = 2, kSearch = 0.7f;
    search_factors_.fill(0);
    for (size_t i = 0; i < factors_.size(); ++i) {
        const GatherTotals::Joins& joins = totals.joins[i];
        const float rms = float(
            std::sqrt((joins.squares / kUnit + kJoins * sqr(kFirst)) / (joins.count + kJoins)));
        factors_[i] = kPair * rms;
        float& search = search_factors_[i % kGatherLengths];
        search = std::max(search, kSearch * rms);
    }
}

void GatherRoulette::observe(int s, int t, float ratio, GatherSums& sums) {
    // A few joins that contribute much more than was estimated are no rule.
    constexpr float kMost = 8;
    GatherSums::Joins& joins = sums.joins[index(s, t)];
    ++joins.count;
    if (ratio > 0) joins.squares += uint64_t(kUnit * sqr(double(std::min(ratio, kMost))));
}

}  // namespace etendue
