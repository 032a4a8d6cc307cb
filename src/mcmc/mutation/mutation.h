#pragma once
// Mutations of paths: each proposes, and knows the density of what it proposes.

#include <memory>

#include "mcmc/path_builder.h"

namespace etendue {

/// How a proposal y was made of x: what was kept, x_0 … x_l and x_m … x_k. Proposals that keep the same make up a step of
/// their own, which keeps the target: Q refers to them alone.
struct MutationWay {
    int l = -1;
    int m = 0, m_y = 0;  ///< Index of the same vertex in x, and in y.
    float angle = 0;     ///< By which a direction was changed.

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
    /// Whether it can change x. Where it cannot, it is not chosen; of what can, one is by weight.
    virtual bool suits(const PathState& x) const = 0;
    /// Makes y without its target; false where there is nothing to propose.
    virtual bool propose(const PathState& x, const MutationContext& c, PathState& y,
                         MutationWay& way) const = 0;
    /// Density of y, made of x in this way; up to a factor that is the same on the way back.
    virtual double Q(const PathState& x, const PathState& y, const MutationWay& way) const = 0;
};

}  // namespace etendue
