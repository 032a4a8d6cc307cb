#pragma once
// Lens sub-path mutation [Veach 1997, §11.4.5]: a new film point, anywhere, and a walk from there to the first vertex that
// can be connected, which is joined to what is kept. Film points are independent of earlier ones.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class LensSubpathMutation final : public PathMutation {
public:
    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    double Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// The first vertex from the eye that could be connected, if it is not the emitter's.
    static int end(const PathState& x);
};

}  // namespace etendue
