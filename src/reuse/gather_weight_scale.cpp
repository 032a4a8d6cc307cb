#include "reuse/gather_weight_scale.h"

#include <algorithm>
#include <cmath>

#include "reuse/gather_constants.h"

namespace etendue {

void GatherWeightScale::learn(const GatherTotals& totals) {
    const auto& moments = totals.second_moments;
    const double least = *std::min_element(moments.begin(), moments.end());
    if (!(least > 0)) return;
    choice_ = 0;
    while (moments[size_t(choice_)] > kGatherConstants.clear_gain * least) ++choice_;
}

void GatherWeightScale::observe(double luminance, double weight, double pair_probability, double r,
                                double seen, GatherSums& sums) const {
    if (!(weight < 1)) return;  // the weight is 1 for every c
    // Odds of the gather, and ratio of the others' density to its own, both for c = 1.
    const double odds = weight / (1 - weight) / sqr(double(value())), others = 1 / std::sqrt(odds);
    for (int k = 0; k < int(kWeightScales); ++k) {
        const double w = 1 / (1 + 1 / (odds * sqr(double(of(k)))));
        const double moment =
            seen * sqr(luminance) * r * (sqr(w) * r + sqr(1 - w) / (others * pair_probability));
        // Fixed point, since integer sums do not depend on their order. The bound is reached by a pair that adds a
        // thousand times the pixel's luminance.
        constexpr double kUnit = 0x1p20, kMost = 1e6 * kUnit;
        if (moment > 0) sums.second_moments[size_t(k)] += uint64_t(std::min(moment * kUnit, kMost));
    }
}

}  // namespace etendue
