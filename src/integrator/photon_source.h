#pragma once
// Sources of the photons in photon maps.

#include <atomic>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "integrator/photon_mapping.h"
#include "reuse/photon_importance.h"

namespace etendue {

/// Photons for both maps. The caustic map is seen directly; the global map contains all light that reaches a surface.
struct MapPhotons {
    std::vector<MapPhoton> global, caustic;
};

class PhotonSource {
public:
    virtual ~PhotonSource() = default;
    /// Returns photons at the surfaces where densities are estimated. Their random numbers are those of pass `pass`.
    /// `importons` samples the points at which the rendering will estimate densities.
    virtual MapPhotons trace(const PassContext& context, uint32_t pass,
                             const std::function<std::vector<Importon>()>& importons) = 0;
    /// Number of light paths traced for the photons.
    virtual uint64_t light_paths() const = 0;
    virtual std::vector<std::pair<std::string, double>> figures() const { return {}; }
};

/// Which vertices of a light path store a photon, from y_1 on.
class PhotonOrigins {
public:
    PhotonOrigins(const PhotonMapping& mapping, const Vertex& y0)
        : mapping_(mapping), by_delta_(y0.emitter->is_delta()) {}
    /// The origin of a photon at the next vertex; empty if none is stored there.
    std::optional<MapPhoton::Origin> next(const Vertex& v) {
        using Origin = MapPhoton::Origin;
        const Origin origin = ++i_ == 1 || !by_glossy_ ? Origin::Any
                              : by_delta_              ? Origin::DeltaCaustic
                                                       : Origin::Caustic;
        by_delta_ &= v.is_delta;
        by_glossy_ &= v.is_delta || !mapping_.is_diffuse(v);
        const bool is_stored =
            v.is_connectible && (mapping_.is_diffuse(v) || origin == Origin::DeltaCaustic);
        return is_stored ? std::optional(origin) : std::nullopt;
    }

private:
    const PhotonMapping& mapping_;
    int i_ = 0;
    bool by_delta_, by_glossy_ = true;
};

/// Calls use(photon) for the photons of the light path y. Their flux is that of this path alone, not divided by N_L.
template <class Use>
void for_each_photon(const PhotonMapping& mapping, const SubPath& y, const Use& use) {
    if (y.size() == 0) return;
    PhotonOrigins origins(mapping, y[0]);
    for (int i = 1; i < y.size(); ++i) {
        const Vertex& v = y[i];
        if (const auto origin = origins.next(v))
            use(MapPhoton{{v.p, v.wo, v.beta, y[0].emitter, i + 1}, *origin, arrival_side(v)});
    }
}

/// Counts the memory of photons. Throws std::runtime_error with advice if a limit is exceeded.
class PhotonMemory {
public:
    explicit PhotonMemory(uint64_t max_bytes) : max_bytes_(max_bytes) {}
    /// May be called by any thread.
    void add(uint64_t photons);

private:
    uint64_t max_bytes_;
    std::atomic<uint64_t> bytes_ = 0;
};

/// Photons from traced light paths.
class TracedPhotons final : public PhotonSource {
public:
    /// trace() throws std::runtime_error if the photons would need more than `max_bytes`.
    TracedPhotons(const PhotonMapping& mapping, uint64_t light_paths, uint64_t max_bytes)
        : mapping_(mapping), light_paths_(light_paths), max_bytes_(max_bytes) {}
    MapPhotons trace(const PassContext& context, uint32_t pass,
                     const std::function<std::vector<Importon>()>& importons) override;
    uint64_t light_paths() const override { return light_paths_; }
    std::vector<std::pair<std::string, double>> figures() const override;

private:
    const PhotonMapping& mapping_;
    uint64_t light_paths_, max_bytes_;
    size_t photons_ = 0;
};

}  // namespace etendue
