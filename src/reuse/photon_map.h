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

/// A tree of points, of nanoflann.
class PointTree;

class PhotonMap {
public:
    static constexpr int kMostNeighbours = 512;

    PhotonMap();
    ~PhotonMap();
    PhotonMap(PhotonMap&&) noexcept;
    PhotonMap& operator=(PhotonMap&&) noexcept;

    /// Changes the order of the photons.
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
    std::vector<MapPhoton> photons_;
    std::unique_ptr<PointTree> tree_;
};

/// Every n-th photon of a map, for queries by the side of the surface.
class PhotonSides {
public:
    PhotonSides();
    ~PhotonSides();

    /// `photons` must outlive this object.
    void build(const PhotonMap& photons, int step);
    /// The nearest of these photons within `radius` that hit a side whose normal is close to `n`: its index in the map
    /// divided by the step.
    std::optional<uint32_t> nearest(Vec3 p, Vec3 n, float radius) const;

private:
    const PhotonMap* photons_ = nullptr;
    size_t step_ = 1;
    std::unique_ptr<PointTree> tree_;
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
    PhotonSides places_;
    int step_ = 1, count_ = 0, longest_ = 0;
    float radius_ = 0;
    enum State : uint8_t { Unknown, InWork, Known };
    std::unique_ptr<std::atomic<uint8_t>[]> states_;
    mutable std::vector<Rgb> values_;
};

}  // namespace etendue
