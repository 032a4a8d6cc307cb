#include "mcmc/mutation/photon_map.h"

#include <cmath>

#include "mcmc/addresses.h"
#include "mcmc/mutation/perturbation.h"

namespace etendue {
namespace {

constexpr float kCone = 30 * kPi / 180;  ///< Half-angle [Fan et al. 2005, §5.3].

}  // namespace

bool PhotonMapMutation::suits(const PathState& x) const {
    const int m = seen(x);
    if (m == 0 || x[m].v.is_delta) return false;
    const int stored = x.before(m, stores_);
    return stored > 0 && x.is_connected_at(stored - 1);
}

bool PhotonMapMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                                MutationWay& way) const {
    const int m = seen(x), l = x.before(m, stores_) - 1;
    c.sampler.seek(Stream::Selection, addresses::kPart);
    const float versine = 2 * float(std::pow(std::sin(kCone / 2), 2)) * c.sampler.next_1d();
    const float u = c.sampler.next_1d();
    PathBuilder builder = c.builder(&x, l, m);
    const Vec3 w = turned(direction(x[m].v, x[m - 1].v), std::acos(1 - versine), u);
    if (!builder.step_eye(given(w))) return false;
    for (int n = l + 3; !stores_(builder.eye_end()); ++n)
        if (n > c.measure.longest || !builder.sample_eye_step()) return false;
    if (!builder.finish(y)) return false;
    way = {.l = l, .m = m, .m_y = y.last() - (x.last() - m)};
    return true;
}

PathDensity PhotonMapMutation::Q(const PathState&, const PathState& y,
                                 const MutationWay& way) const {
    // The density in the cone is the same in both directions.
    PathDensity p = y.geometry_from_eye(way.m_y - 1);
    for (int i = way.m_y - 2; i > way.l; --i) p *= y.eye(i);
    return p;
}

}  // namespace etendue
