#pragma once
// Mutations of paths: each makes proposals and evaluates their density Q.

#include <memory>

#include "mcmc/path_builder.h"

namespace etendue {

/// How a proposal y was made from x: x_0 … x_l and x_m … x_k are kept. Q is the density among the proposals that keep these
/// parts; for each choice of them, the steps leave the target invariant.
struct MutationWay {
    int l = -1;
    int m = 0, m_y = 0;  ///< Index of the same vertex in x and in y.
    float angle = 0;     ///< Angle in radians by which a direction was turned.

    MutationWay back() const { return {l, m_y, m, angle}; }
};

struct MutationContext {
    const PathMeasure& measure;
    const ChainContext& chain;
    Sampler& sampler;

    PathBuilder builder(const PathState* x, int l, int m) const {
        return {measure, sampler, chain.work, x, l, m};
    }
};

class PathMutation {
public:
    virtual ~PathMutation() = default;
    /// Whether it can change x. One of the mutations for which this is true is chosen, in proportion to their weights.
    virtual bool suits(const PathState& x) const = 0;
    /// Makes y without its target; false if there is nothing to propose.
    virtual bool propose(const PathState& x, const MutationContext& c, PathState& y,
                         MutationWay& way) const = 0;
    /// Density of the proposal y from x in this way, up to a factor that is the same for the way back.
    virtual PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const = 0;
};

}  // namespace etendue
