#pragma once
// Survival probability of a pair in the Russian roulette before its light path is looked up.

#include <algorithm>

#include "reuse/gather_sums.h"

namespace etendue {

/// The roulette estimates the contribution of a pair's join from the flux of the light vertex and the throughput of the
/// eye path. The error of this estimate depends on the lengths of the two sub-paths, since the MIS weight of a gather
/// does. Therefore the root mean square of the ratio of contribution to estimate is learned from joins of earlier
/// passes, by s and t: the most efficient survival probability is proportional to it.
class GatherRoulette {
public:
    /// Learns from the sums of earlier passes; the ratio is 1/8 where there are none.
    void learn(const GatherTotals& totals);
    /// Factor of the estimate for the pair of y_{s-1} and z_{t-1}.
    float of(int s, int t) const { return factors_[index(s, t)]; }
    /// Factor for the roulette of the search for all pairs of z_{t-1}.
    float of_search(int t) const { return search_factors_[column(t)]; }

    /// Records the ratio of a join's contribution to its estimate: 0 where the join failed; NaN counts as 0.
    static void observe(int s, int t, float ratio, GatherSums& sums);

private:
    static size_t column(int length) {
        return size_t(std::min(length - 2, int(kGatherLengths) - 1));
    }
    static size_t index(int s, int t) { return column(s) * kGatherLengths + column(t); }

    std::array<float, kGatherLengths * kGatherLengths> factors_{};
    std::array<float, kGatherLengths> search_factors_{};
};

}  // namespace etendue
