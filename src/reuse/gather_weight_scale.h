#pragma once
// How much weights count a gather.

#include "reuse/gather_sums.h"

namespace etendue {

/// Weights take the probability that a pair is found for that of a disc, π r² p [Qin et al. 2015, eq. 24]. Where
/// surfaces are small or curved it is less, and 1/p_c with all its noise more. So gathers count c N_L in the weights, where c
/// is that of a few values for which the second moment of a pixel's estimate,
///     ∫ w(c)² f² / (N_L p p_c) + (1 - w(c))² f² / (N_S p_S),
/// is least, the pixel's luminance being the unit: w is the weight of the gather, S the other techniques as if they were
/// one. Pairs and their r of earlier passes estimate it, so that an image keeps the right expectation.
class GatherWeightScale {
public:
    /// Chooses c from the sums of earlier passes: the largest with nearly the least moment; 1/2 where there are none.
    void learn(const GatherTotals& totals);
    /// c.
    float value() const { return of(choice_); }

    /// One visible pair. `luminance`: what it would add to its pixel, over the pixel's, with weight 1, r = 1 and
    /// `weight` given for the present c; `seen`: the inverse of the probability that roulette let it be seen.
    void observe(double luminance, double weight, double pair_probability, double r, double seen,
                 GatherSums& sums) const;

private:
    static float of(int choice) { return 1.0f / float(1 << choice); }

    int choice_ = 1;
};

}  // namespace etendue
