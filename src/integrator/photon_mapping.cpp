#include "integrator/photon_mapping.h"

#include <stdexcept>

#include <fmt/format.h>

namespace etendue {

std::vector<ParamInfo> PhotonMapping::params() {
    std::vector<ParamInfo> params = Bidirectional::params();
    params.push_back({"roughness", ParamKind::Float, "0.1",
                      "Photons are used at surfaces whose sharpest smooth lobe is at least this "
                      "rough (α of GGX, in [0, 1]; diffuse: 1); at other surfaces eye paths "
                      "continue."});
    return params;
}

PhotonMapping::PhotonMapping(const IntegratorParams& p, bool next_event)
    : paths_(p), roughness_(p.number("roughness")), next_event_(next_event) {
    if (!(roughness_ >= 0 && roughness_ <= 1))
        throw std::runtime_error(fmt::format("{}: roughness must lie in [0, 1]", p.integrator()));
}

void PhotonMapping::add_direct(const SampleContext& c, int t, Workspace& work) const {
    const SubPath& z = work.z;
    paths_.add_hits(c, counts(), t, work);
    if (!next_event_ || !paths_.is_joinable(z, t)) return;
    // At a diffuse vertex the eye path does not continue by a smooth event, so no hit can make the path of the next
    // event.
    const TechniqueCounts alone{.next_event = 1};
    paths_.add(c,
               join_next_event(c.scene, z, t, c.sampler, is_diffuse(z[t - 1]) ? alone : counts()),
               work);
}

bool PhotonMapping::walk_on(const WalkContext& walk, Sampler& sampler, SubPath& z,
                            bool only_delta) const {
    const int t = z.size();
    if (only_delta && !z[t - 1].bsdf.has_delta()) return false;
    if (!extend<TransportMode::Radiance>(walk, sampler, z)) return false;
    if (!only_delta || z[t - 1].is_delta) return true;
    z.truncate(t);
    return false;
}

}  // namespace etendue
