#pragma once
// Visual importance of photons: the density of importons, which are the points where a rendering estimates photon
// densities [Peter & Pietrek 1998]. Constant during a rendering, and positive everywhere.

#include <span>

#include "reuse/arrival_side.h"
#include "reuse/photon_map.h"
#include "reuse/point_grid.h"

namespace etendue {

/// A point at which a rendering estimates the density of photons.
struct Importon {
    Vec3 p;
    ArrivalSide side;
    float importance;  ///< Contribution to the image of a unit of radiance from this point.
    bool is_caustic;   ///< Whether the density estimate uses the caustic map.
};

class PhotonImportance {
public:
    /// Importance is the density of importons within `radius`. The floor is 0 until set_floor() is called.
    PhotonImportance(std::span<const Importon> importons, float radius);
    /// Sets the smallest importance of any photon.
    void set_floor(float floor) { floor_ = floor; }

    /// Importance per area at the photon. If it is a caustic, that of both maps.
    float operator()(const MapPhoton& photon) const;

private:
    /// Tags of entries: the arrival side, and this bit above it for the caustic map.
    static constexpr uint32_t kCaustic = 1u << 16;

    PointGrid grid_;
    float radius_, floor_ = 0;
};

}  // namespace etendue
