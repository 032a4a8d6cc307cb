#pragma once
// Photon map proposal [Fan et al. 2005, §5.3]: the direction from the first vertex from the eye that stores photons is turned,
// as for another ray of a final gather. The eye sub-path continues to the next vertex that stores photons, which is joined
// to the kept part.
//
// Directions are uniform in solid angle within the cone.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class PhotonMapMutation final : public PathMutation {
public:
    explicit PhotonMapMutation(std::function<bool(const Vertex&)> stores)
        : stores_(std::move(stores)) {}

    bool suits(const PathState& x) const override;
    bool propose(const PathState& x, const MutationContext& c, PathState& y,
                 MutationWay& way) const override;
    PathDensity Q(const PathState& x, const PathState& y, const MutationWay& way) const override;

private:
    /// Index of the first vertex from the eye that stores photons; 0 if there is none.
    int seen(const PathState& x) const { return x.before(x.last(), stores_); }

    std::function<bool(const Vertex&)> stores_;
};

}  // namespace etendue
