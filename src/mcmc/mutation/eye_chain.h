#pragma once
// Lens perturbation and multi-chain perturbation [Veach 1997, §11.4.2 and §11.4.4]: the film point moves slightly, and the
// eye sub-path follows the same delta events as before, up to a vertex that is joined to the kept part, or up to the
// emitter. At a vertex between two chains of delta events, the new direction is that toward the old vertex, turned by a
// small angle. Veach turns the old direction instead, which misses the old vertex by as much as the vertex between the
// chains has moved.

#include "mcmc/mutation/perturbation.h"

namespace etendue {

class EyeChainMutation final : public PathMutation {
public:
    enum class Kind {
        Lens,        ///< At most one chain of delta events.
        MultiChain,  ///< More than one.
        Glossy       ///< With glossy reflections, which are followed as delta events are.
    };
    EyeChainMutation(Kind kind, const PathMeasure& measure);

    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// What happens at a vertex of the eye sub-path.
    enum class Role {
        RepeatsEvent,
        TurnsDirection,  ///< Between two chains.
        IsJoined         ///< To the kept part; the last vertex that is replaced.
    };
    /// Role of x_i, if none of those between it and the lens is joined; `is_glossy`: whether one of them repeats a glossy
    /// reflection.
    Role role(const PathState& x, int i, bool is_glossy) const;

    struct Chains {
        int end;    ///< x_end … x_{k-1} are replaced; 0: up to the emitter, which the chain hits.
        int turns;  ///< Vertices among them whose direction is turned.
        bool is_glossy;  ///< Whether glossy reflections are among them.
    };
    Chains chains(const PathState& x) const;

    Kind kind_;
    Followed events_;
    LogRange range_;
};

}  // namespace etendue
