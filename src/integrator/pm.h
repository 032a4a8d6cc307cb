#pragma once

#include <functional>
#include <memory>

#include "integrator/photon_source.h"

namespace etendue {

IntegratorEntry pm_entry();

/// Parameters of all integrators that render photon maps. `paths` is the parameter that determines the number of
/// photons.
std::vector<ParamInfo> photon_map_params(const ParamInfo& paths);
using MakePhotonSource = std::function<std::unique_ptr<PhotonSource>(
    const IntegratorParams&, const PhotonMapping&, uint64_t max_bytes)>;
/// Makes an integrator that renders photon maps with photons from `source`.
std::unique_ptr<Integrator> make_photon_map_integrator(const IntegratorParams& params,
                                                       const MakePhotonSource& source);

}  // namespace etendue
