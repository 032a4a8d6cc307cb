#pragma once
// A photon map with queries for the photons nearest to a point [Jensen 2001, §6].

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "pathspace/photon.h"

namespace etendue {

/// A photon stored without its path. Its power is a share of the flux of all light.
struct MapPhoton : Photon {
    /// Events on its path before: any; at least one, none of them on a diffuse surface; or at least one, all of them
    /// delta events, from a delta emitter.
    enum class Origin : uint8_t { Any, Caustic, DeltaCaustic } origin = Origin::Any;

    bool is_caustic() const { return origin != Origin::Any; }
};

class PhotonMap {
public:
    static constexpr int kMostNeighbours = 512;

    PhotonMap();
    ~PhotonMap();
    PhotonMap(PhotonMap&&) noexcept;
    PhotonMap& operator=(PhotonMap&&) noexcept;

    void build(std::vector<MapPhoton> photons);
    std::span<const MapPhoton> photons() const { return photons_; }

    /// The photons of a density estimate, and the area of its disc.
    struct Neighbours {
        std::array<uint32_t, kMostNeighbours> index;
        int count;
        float disc;
    };
    /// The `count` photons nearest to `p`, within `radius`. If there are that many, the last one only determines the
    /// radius of the disc: (k-1) / (π r_k²) is an unbiased estimate of a uniform density, k / (π r_k²) is not
    /// [Loftsgaarden & Quesenberry 1965].
    void find(Vec3 p, int count, float radius, Neighbours& out) const;

private:
    struct Tree;
    std::vector<MapPhoton> photons_;
    std::unique_ptr<Tree> tree_;
};

}  // namespace etendue
