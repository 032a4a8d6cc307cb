#pragma once
// Caustic perturbation [Veach 1997, §11.4.3]: the direction from the emitter, or from the last vertex before a chain of
// delta events (or of glossy reflections), is turned by a small angle. The light sub-path follows the same events as before,
// to the vertex that the lens sees.

#include "mcmc/mutation/perturbation.h"

namespace etendue {

class CausticMutation final : public PathMutation {
public:
    /// With Followed::Glossy, only paths with glossy reflections are perturbed.
    CausticMutation(Followed events, const PathMeasure& measure);

    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// The vertex whose direction is turned.
    int first(const PathState& x) const;
    /// Angles in radians (for emitters at infinity, distances in scene units) that move x_{k-1} as far as film_range() does.
    LogRange range(const PathState& x, int first) const;

    Followed events_;
    const PathMeasure& measure_;
    LogRange film_;
};

}  // namespace etendue
