#pragma once
// Photon map proposal [Fan et al. 2005, §5.3]: the direction from the first vertex that the eye sees is turned, as for
// another ray of a final gather. The eye sub-path continues by delta events to the next vertex that can be connected, where
// the photon is stored, and this vertex is joined to the kept part.
//
// Directions are uniform in solid angle within the cone.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class PhotonMapMutation final : public PathMutation {
public:
    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    double Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// Index of the next vertex before x_i, toward the light, that can be connected; 0 if there is none.
    static int next(const PathState& x, int i);
    /// Index of the first vertex from the eye that can be connected; 0 if there is none.
    static int seen(const PathState& x) { return next(x, x.last()); }
};

}  // namespace etendue
