#pragma once

#include <functional>
#include <memory>

#include "integrator/photon_source.h"

namespace etendue {

IntegratorEntry pm_entry();

/// Parameters of all integrators that render photon maps; `paths` is that of their number of light paths.
std::vector<ParamInfo> photon_map_params(const ParamInfo& paths);
using MakePhotonSource = std::function<std::unique_ptr<PhotonSource>(
    const IntegratorParams&, const PhotonMapping&, uint64_t max_bytes)>;
/// Renders maps with photons from another source.
std::unique_ptr<Integrator> make_photon_map_integrator(const IntegratorParams& params,
                                                       const MakePhotonSource& source);

}  // namespace etendue
