#pragma once
// Manifold perturbation, after [Jakob & Marschner 2012]: a lens perturbation of a path E S+ D S+ L, where D is the first
// vertex without delta event from the lens, and L an emitter or the next vertex without one. D moves, L stays, and the
// chain of delta events between them is solved for its new end by Newton's method. The proposal is possible only if the
// solution for the old end, begun from the new chain, is the old chain.
//
// [Jakob & Marschner 2012] move three vertices, and step along the manifold; here the chain is solved at once, from the
// direction toward its old first vertex.

#include "manifold/chain.h"
#include "mcmc/mutation/perturbation.h"

namespace etendue {

class ManifoldMutation final : public PathMutation {
public:
    explicit ManifoldMutation(const PathMeasure& measure);

    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    const Scene& scene_;
    LogRange range_;
};

}  // namespace etendue
