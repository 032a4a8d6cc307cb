#pragma once
// A photon map: the nearest photons of a point [Jensen 2001, §6].

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "pathspace/photon.h"

namespace etendue {

/// A photon that is kept without its path. Its power is a share of the flux of all light.
struct MapPhoton : Photon {
    /// What its path met before: anything; one surface or more, none of them diffuse enough; or one or more by delta
    /// events alone, from an emitter without extent.
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

    /// The photons of a density estimate, and the area they are spread over.
    struct Neighbours {
        std::array<uint32_t, kMostNeighbours> index;
        int count;
        float disc;
    };
    /// The `count` photons nearest to `p`, within `radius`. Where there are so many the last one only tells the disc's
    /// radius: (k-1) / (π r_k²) is an unbiased estimate of a uniform density, k / (π r_k²) is not [Loftsgaarden & Quesenberry 1965].
    void find(Vec3 p, int count, float radius, Neighbours& out) const;

private:
    struct Tree;
    std::vector<MapPhoton> photons_;
    std::unique_ptr<Tree> tree_;
};

}  // namespace etendue
