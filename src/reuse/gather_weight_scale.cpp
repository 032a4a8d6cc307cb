#include "reuse/gather_weight_scale.h"

#include <algorithm>
#include <cmath>

namespace etendue {

void GatherWeightScale::learn(const GatherTotals& totals) {
    const auto& moments = totals.second_moments;
    const double least = *std::min_element(moments.begin(), moments.end());
    if (!(least > 0)) return;
    // A few bright pairs decide the moments of large c: these are given up only where it is clear.
    constexpr double kClear = 1.25;
    choice_ = 0;
    while (moments[size_t(choice_)] > kClear * least) ++choice_;
}

void GatherWeightScale::observe(double luminance, double weight, double pair_probability, double r,
                                double seen, GatherSums& sums) const {
    if (!(weight < 1)) return;  // whatever c is
    // Odds of the gather and density of the others over its own, both for c = 1.
    const double odds = weight / (1 - weight) / sqr(double(value())), others = 1 / std::sqrt(odds);
    for (int k = 0; k < int(kWeightScales); ++k) {
        const double w = 1 / (1 + 1 / (odds * sqr(double(of(k)))));
        const double moment =
            seen * sqr(luminance) * r * (sqr(w) * r + sqr(1 - w) / (others * pair_probability));
        // Whole numbers, since their sum does not depend on the order. The bound is that of a pair as bright as a thousand
        // pixels.
        constexpr double kUnit = 0x1p20, kMost = 1e6 * kUnit;
        if (moment > 0) sums.second_moments[size_t(k)] += uint64_t(std::min(moment * kUnit, kMost));
    }
}

}  // namespace etendue
