#pragma once
// Lens sub-path mutation [Veach 1997, §11.4.5]: draws a new film point anywhere, and walks from there to the first vertex
// that can be connected, which is joined to the kept part. Film points are independent of earlier ones; they are not
// stratified.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class LensSubpathMutation final : public PathMutation {
public:
    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// Index of the first vertex from the eye that can be connected; 0 if only the emitter remains.
    static int end(const PathState& x);
};

}  // namespace etendue
