#pragma once
// Factor of the sample count of gathers in MIS weights.

#include "reuse/gather_moment.h"
#include "reuse/gather_sums.h"

namespace etendue {

/// MIS weights approximate the probability that a pair is found by that of a disc, π r² p [Qin et al. 2015, eq. 24]. On
/// small or curved surfaces it is smaller, so that 1/p_c is larger and noisier. Therefore gathers count c N_L samples
/// in the weights. c is the one of a few candidates that minimises the second moment of a pixel's estimate
/// (GatherMoment). It is estimated from the pairs, and their r, of earlier passes, so that the image remains unbiased.
class GatherWeightScale {
public:
    /// Chooses c from the sums of earlier passes: the largest whose moment is close to the least; 1/2 where there are
    /// none.
    void learn(const GatherTotals& totals);
    /// c.
    float value() const { return of(choice_); }

    /// Records one visible pair.
    static void observe(const GatherMoment& pair, GatherSums& sums);

private:
    static float of(int choice) { return 1.0f / float(1 << choice); }

    int choice_ = 1;
};

}  // namespace etendue
