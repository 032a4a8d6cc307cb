#pragma once
// How likely a pair is to survive the roulette before its light path is looked up.

#include <algorithm>

#include "reuse/gather_sums.h"

namespace etendue {

/// The roulette estimates what the join of a pair will add to the pixel from the light vertex's flux and the eye path's
/// throughput alone. The error of that estimate depends on the lengths of the two sub-paths, since the weight of a gather
/// does. So joins of earlier passes tell the root mean square of the ratio of their contribution to the estimate, by s
/// and t: the survival with the least variance for its cost is proportional to it.
class GatherRoulette {
public:
    /// From the sums of earlier passes; as if the ratio were 1/8 where there are none.
    void learn(const GatherTotals& totals);
    /// Factor of the estimate for the pair of y_{s-1} and z_{t-1}.
    float of(int s, int t) const { return factors_[index(s, t)]; }
    /// Of the search for the pairs of z_{t-1}, which may find several.
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
