#pragma once
// Proposals from user paths [Fan et al. 2005, §5.1]: a light sub-path close to a user path replaces that of the present
// path, up to the first vertex from the eye that is not a delta event. Few paths could be proposed in this way on the way
// back. PathSpace::Q() therefore adds their density to that of bidirectional mutations that keep the same part
// [Fan et al. 2005, eq. 7].

#include "mcmc/mutation/mutation.h"
#include "mcmc/user_paths.h"

namespace etendue {

class UserPathMutation final : public PathMutation {
public:
    explicit UserPathMutation(const UserPaths& paths) : paths_(paths) {}

    bool suits(const PathState& x) const override { return kept(x) > 0; }
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;
    /// Whether a mutation of this way keeps the same part as proposals from user paths.
    static bool is_way(const PathState& x, const MutationWay& way) {
        return way.l == -1 && way.m == kept(x);
    }

private:
    /// x_m … x_k are kept.
    static int kept(const PathState& x);

    const UserPaths& paths_;
};

}  // namespace etendue
