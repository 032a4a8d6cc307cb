#pragma once
// How many partners a vertex has, for the weights.

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace etendue {

/// All pairs of one eye vertex share its eye path: their errors are the same where many partners lie about it, and N_L of
/// them are worth as much as N_L/(1 + n), n being the partners that it has. (Of the pixel's estimate Σ w C r / N_L the
/// variance is at most 1/N_L of what N_L independent pairs bring, and that of the vertex alone, whose photons stand for the
/// light sub-paths that can reach it: 1/n_eff = 1/N_L + n/N_L. Compare the upper bound of [Popov et al. 2015, §5].)
///
/// n comes from an earlier pass, so that it is a function of the place alone and weights still sum to one.
class PairDensity {
public:
    /// `points`: the light vertices of that pass; `radius`: of pairs.
    void build(std::span<const Vec3> points, float radius);
    /// 1/(1 + n) at `p`; 1 before build().
    double share(Vec3 p) const;

private:
    uint32_t cell_of(Vec3 p) const;

    float inv_cell_ = 1;
    uint32_t mask_ = 0;
    std::vector<uint32_t> counts_;  ///< Of hashed cells, twice the radius wide.
};

}  // namespace etendue
