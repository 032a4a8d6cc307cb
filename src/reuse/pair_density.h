#pragma once
// Estimated number of partners of a vertex, for MIS weights.

#include <vector>

#include "pathspace/learned_state.h"
#include "pathspace/walk.h"
#include "reuse/point_grid.h"

namespace etendue {

/// All pairs of one eye vertex share its eye path. If the errors of n pairs have the correlation ρ, they are worth
/// n/(1 + ρ n) independent pairs. Where N_L light paths have n vertices around an eye vertex, its pairs therefore count
/// N_L/(1 + ρ n) in the weights. (For ρ = 1, 1/n_eff = 1/N_L + n/N_L: the variance of independent pairs plus that of
/// the eye vertex. Compare the upper bound of [Popov et al. 2015, §5] and [Grittmann et al. 2021].)
///
/// n is estimated in an earlier pass. It is a function of the position only, so that weights still sum to one.
class PairDensity final : public LearnedPlaces {
public:
    /// Before anything is learned: pairs have the smallest weight, so that they contribute only to paths that no other
    /// technique makes.
    PairDensity() = default;
    /// Learns from light vertices, each of which stands for `multiple` of a pass; `radius` is that of pairs,
    /// `correlation` is ρ.
    PairDensity(const CellCounts& vertices, float radius, double correlation, double multiple = 1);

    /// Level of the share 1/(1 + ρ n) at `p`; the rounding error is about 2 %.
    uint8_t pair_level(Vec3 p) const override {
        return levels_.empty() ? uint8_t(255) : levels_[cells_.bucket_of(cells_.cell_of(p))];
    }
    /// n, with the same precision.
    float partners(uint8_t level) const {
        return correlation_ > 0 ? float((1 / pair_share(level) - 1) / correlation_) : 0.0f;
    }

    void save(LearnedState& to) const {
        to.put(cells_);
        to.put(levels_);
        to.put(correlation_);
    }
    void load(LearnedState& from) {
        from.get(cells_);
        from.get(levels_);
        from.get(correlation_);
    }

private:
    CellHash cells_;
    std::vector<uint8_t> levels_;  ///< By bucket of cells_.
    double correlation_ = 0;
};

}  // namespace etendue
