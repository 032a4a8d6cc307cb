#pragma once
// Photon maps: queries for the photons nearest to a point [Jensen 2001, §6], and irradiance computed at photons
// [Christensen 1999].

#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "pathspace/photon.h"
#include "reuse/arrival_side.h"

namespace etendue {

/// A photon stored without its path. Its power is a fraction of the total flux.
struct MapPhoton : Photon {
    /// Scattering events of the light path before the photon. Any: no condition. Caustic: at least one, and none on a
    /// diffuse surface. DeltaCaustic: the same, with delta events alone and from a delta emitter.
    enum class Origin : uint8_t { Any, Caustic, DeltaCaustic } origin = Origin::Any;
    ArrivalSide side;  ///< Side of the surface that the photon hit.

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

    /// The nearest photon within `radius` whose index is a multiple of `step`, and which hit a side whose normal is close
    /// to `n`.
    std::optional<uint32_t> nearest_on_side(Vec3 p, Vec3 n, int step, float radius) const;

private:
    struct Tree;
    std::vector<MapPhoton> photons_;
    std::unique_ptr<Tree> tree_;
};

/// Irradiance at every n-th photon of a map, from a density estimate. It is computed when it is first needed, because
/// many photons are never needed.
class PhotonIrradiance {
public:
    /// Density estimates use find(count, radius) and photons with at most `longest` vertices. `photons` must outlive
    /// this object.
    void begin(const PhotonMap& photons, int step, int count, float radius, int longest);

    /// Irradiance at the nearest of these photons on the side with the normal `n`; empty where none is within the radius.
    std::optional<Rgb> find(Vec3 p, Vec3 n) const;

private:
    Rgb compute(uint32_t photon) const;

    const PhotonMap* photons_ = nullptr;
    int step_ = 1, count_ = 0, longest_ = 0;
    float radius_ = 0;
    enum State : uint8_t { Unknown, InWork, Known };
    std::unique_ptr<std::atomic<uint8_t>[]> states_;
    mutable std::vector<Rgb> values_;
};

}  // namespace etendue
