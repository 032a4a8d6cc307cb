#pragma once
// Where the photons of photon maps come from.

#include <vector>

#include "integrator/photon_mapping.h"
#include "reuse/photon_map.h"

namespace etendue {

class PhotonSource {
public:
    virtual ~PhotonSource() = default;
    /// Photons at all surfaces where density estimates are made; together they have all the flux that arrives there.
    virtual std::vector<MapPhoton> trace(const PassContext& pass) = 0;
};

/// Photons of the pass's light paths.
class TracedPhotons final : public PhotonSource {
public:
    /// trace() throws std::runtime_error where the photons would take more than `max_bytes`.
    TracedPhotons(const PhotonMapping& mapping, uint64_t max_bytes)
        : mapping_(mapping), max_bytes_(max_bytes) {}
    std::vector<MapPhoton> trace(const PassContext& pass) override;

private:
    const PhotonMapping& mapping_;
    uint64_t max_bytes_;
};

}  // namespace etendue
