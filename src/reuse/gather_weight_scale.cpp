#include "reuse/gather_weight_scale.h"

#include <algorithm>

#include "reuse/gather_constants.h"

namespace etendue {

void GatherWeightScale::learn(const GatherTotals& totals) {
    const auto& moments = totals.weight_moments;
    const double least = *std::min_element(moments.begin(), moments.end());
    if (!(least > 0)) return;
    choice_ = 0;
    while (moments[size_t(choice_)] > kGatherConstants.clear_gain * least) ++choice_;
}

void GatherWeightScale::observe(const GatherMoment& pair, GatherSums& sums) {
    if (pair.is_alone()) return;  // the weight is 1 for every c
    for (int k = 0; k < int(kWeightScales); ++k)
        sums.weight_moments[size_t(k)] += GatherMoment::fixed(pair.with(1, double(of(k))));
}

}  // namespace etendue
