#include "integrator/photon_mapping.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<ParamInfo> PhotonMapping::params() {
    std::vector<ParamInfo> params = Bidirectional::params();
    params.push_back(
        {"roughness", ParamKind::Float, "0.1",
         "Surfaces whose sharpest smooth lobe is at least as rough (α of GGX; diffuse: 1) "
         "are diffuse enough for photons; elsewhere eye paths go on."});
    return params;
}

PhotonMapping::PhotonMapping(const IntegratorParams& p, bool next_event)
    : paths_(p), roughness_(p.number("roughness")), next_event_(next_event) {
    if (!(roughness_ >= 0 && roughness_ <= 1))
        throw std::runtime_error(fmt::format("{}: roughness must lie in [0, 1]", p.integrator()));
}

void PhotonMapping::add_next_event(const SampleContext& c, int t, bool ends,
                                   Workspace& work) const {
    // No hit can follow the smooth event at which the path ends.
    const TechniqueCounts alone{.next_event = 1};
    paths_.add_if_visible(
        c, join_next_event(c.scene, work.z, t, c.sampler, ends ? alone : counts()), work);
}

}  // namespace etendue
