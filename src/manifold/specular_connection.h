#pragma once
// Specular connections X(s,t): an eye vertex z_{t-1} and a point y_0 on a lamp, drawn as light walks draw it, are connected
// by a chain of s-1 delta events, found by Newton's method from a random seed [Zeltner et al. 2020]. The probability P with
// which a seed leads to the chain is unknown. So its contribution is multiplied by the number of seeds until one leads to
// the chain again, whose mean is 1/P [Booth 2007]. Unbiased.
//
// X is used only for paths that no technique of the method but hits makes. Their weights cannot use P. They use
// p̂ = c p(y_0) J Π P_j instead, with a constant c, the spread J ≤ 1 of the chain, and the probabilities P_j of the events,
// which are those of a hit, too.

#include "manifold/seeds.h"
#include "pathspace/join.h"
#include "pathspace/sample_context.h"

namespace etendue {

/// P over Π P_j and the spread, as weights take it: in several scenes, where half of the seeds went toward clear shapes, the
/// mean was 0.1 to 0.6, and a number of trials with the mean 1/P has the variance of P/2 samples.
inline constexpr double kSolutionShare = 0.15;
/// Where a chain spreads directions more than a straight ray of its length does, few seeds lead to each solution. `jacobian`:
/// as Passing::jacobian(); at infinity `length` is 1.
inline double spread(double jacobian, double length) {
    return std::fmin(1, jacobian * sqr(length));
}

struct SpecularLimits {
    int max_depth;  ///< Most edges of a path.
    /// Searches whose expected contribution to the pixel has a smaller luminance are subject to Russian roulette; 0: none.
    float threshold = 0;
    uint64_t most_trials = 10'000'000;
    /// Where a search takes more: whether the contribution is left out, which is counted; or else it is that of `most_trials`.
    bool gives_up = true;
    /// From which seeds are drawn, too; must not depend on the sample.
    const SeedPhotons* photons = nullptr;
};

/// Whether paths whose eye path begins with z_0 … z_{t-1}, and goes on from there by delta events to a lamp, are made by hits
/// alone (and by light paths that hit the lens) if there are no specular connections.
bool is_left_to_hits(const SubPath& z, int t, const TechniqueCounts& counts);

/// X(s,t) for a random s. The contribution includes visibility and the number of trials. If the workspace is observed,
/// work.pair becomes the light side. `sampler` must be that of the sample.
std::optional<Join> join_specular(const Scene& scene, const SubPath& z, int t,
                                  const SpecularLimits& limits, Sampler& sampler,
                                  const TechniqueCounts& counts, Workspace& work);

/// Factor of the weight of C(0,t), the hit of `emitter` at z_{t-1}: 1 where no specular connection makes the path.
float hit_beside_specular(const Scene& scene, const SubPath& z, int t, const Emitter& emitter,
                          const TechniqueCounts& counts);
/// Factor of the weight of C(s+1,0), the hit of the lens by a ray from y_{s-1}.
float hit_lens_beside_specular(const Scene& scene, const SubPath& y, int s,
                               const TechniqueCounts& counts);

}  // namespace etendue
