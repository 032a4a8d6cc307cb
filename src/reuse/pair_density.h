#pragma once
// How many partners a vertex has, for the weights.

#include <vector>

#include "pathspace/learned_state.h"
#include "pathspace/walk.h"
#include "reuse/point_grid.h"

namespace etendue {

/// All pairs of one eye vertex share its eye path. If the errors of n of them have a correlation ρ they are worth
/// n/(1 + ρ n), and where N_L light paths leave n partners about a vertex, its pairs count N_L/(1 + ρ n) in the weights.
/// (At ρ = 1 that is 1/n_eff = 1/N_L + n/N_L: the variance of independent pairs, and that of the vertex alone. Compare the
/// upper bound of [Popov et al. 2015, §5] and [Grittmann et al. 2021].)
///
/// n comes from an earlier pass, so that it is a function of the place alone and weights still sum to one.
class PairDensity final : public LearnedPlaces {
public:
    /// Nothing is known yet: pairs count next to nothing, so that a first pass leaves them what no other technique makes.
    PairDensity() = default;
    /// From the light vertices of that pass; `radius`: of pairs; `correlation`: ρ.
    PairDensity(const CellCounts& vertices, float radius, double correlation);

    /// Of 1/(1 + ρ n) at `p`, to about 2 %: weights need it small in memory, not exact.
    uint8_t pair_level(Vec3 p) const override {
        return levels_.empty() ? uint8_t(255) : levels_[cells_.bucket_of(cells_.cell_of(p))];
    }
    /// n, as exactly.
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
    std::vector<uint8_t> levels_;  ///< Of the buckets of cells.
    double correlation_ = 0;
};

}  // namespace etendue
