#pragma once
// How many partners a vertex has, for the weights.

#include <array>
#include <vector>

#include "pathspace/cell_hash.h"

namespace etendue {

class PointGrid;

/// All pairs of one eye vertex share its eye path. If the errors of n of them have a correlation ρ they are worth
/// n/(1 + ρ n), and where N_L light paths leave n partners about a vertex, its gathers count N_L/(1 + ρ n) in the weights.
/// (At ρ = 1 that is 1/n_eff = 1/N_L + n/N_L: the variance of independent pairs, and that of the vertex alone. Compare the
/// upper bound of [Popov et al. 2015, §5].)
///
/// n comes from an earlier pass, so that it is a function of the place alone and weights still sum to one.
class PairDensity {
public:
    /// All partners count.
    PairDensity();
    /// From the light vertices of that pass; `radius`: of pairs.
    PairDensity(const PointGrid& vertices, float radius);
    /// What is known at `p`, which vertices remember, since finding it takes the time.
    uint8_t level(Vec3 p) const {
        return levels_.empty() ? uint8_t(0) : levels_[cells_.bucket_of(cells_.cell_of(p))];
    }
    /// 1/(1 + ρ n) to about 2 %: weights need it small in memory, not exact.
    double share(uint8_t level) const { return double(shares_[level]); }
    /// n, as exactly.
    float partners(uint8_t level) const { return (1 / shares_[level] - 1) / float(kCorrelation); }

    /// ρ. What competes with a gather shares most of the eye path too, hence far less than 1: of 0.05, 0.2, 0.5 and 1, 0.2 had
    /// the least errors on scenes with few and with many partners (veach-ajar, staircase2, veach-bidir, living-room).
    static constexpr double kCorrelation = 0.2;

private:
    CellHash cells_;
    std::vector<uint8_t> levels_;    ///< Of the buckets of cells.
    std::array<float, 256> shares_;  ///< By level.
};

}  // namespace etendue
