#pragma once
// Factor of the sample count of gathers in MIS weights.

#include "reuse/gather_sums.h"

namespace etendue {

/// MIS weights approximate the probability that a pair is found by that of a disc, π r² p [Qin et al. 2015, eq. 24]. On
/// small or curved surfaces it is smaller, so that 1/p_c is larger and noisier. Therefore gathers count c N_L samples
/// in the weights. c is the one of a few candidates that minimises the second moment of a pixel's estimate, relative to
/// its luminance,
///     ∫ w(c)² f² / (N_L p p_c) + (1 - w(c))² f² / (N_S p_S),
/// where w is the weight of the gather, and S stands for all other techniques together. It is estimated from the pairs,
/// and their r, of earlier passes, so that the image remains unbiased.
class GatherWeightScale {
public:
    /// Chooses c from the sums of earlier passes: the largest whose moment is close to the least; 1/2 where there are
    /// none.
    void learn(const GatherTotals& totals);
    /// c.
    float value() const { return of(choice_); }

    /// Records one visible pair. `luminance`: its contribution for weight 1 and r = 1, relative to the pixel's
    /// luminance; `weight`: its MIS weight for the current c; `seen`: the inverse of the probability that it survived
    /// roulette.
    void observe(double luminance, double weight, double pair_probability, double r, double seen,
                 GatherSums& sums) const;

private:
    static float of(int choice) { return 1.0f / float(1 << choice); }

    int choice_ = 1;
};

}  // namespace etendue
