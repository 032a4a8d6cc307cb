#pragma once
// Visual importance of photons: the density of importons, which lie where a rendering looks for photons [Peter & Pietrek
// 1998]. Frozen, and positive everywhere.

#include <span>

#include "reuse/arrival_side.h"
#include "reuse/photon_map.h"
#include "reuse/point_grid.h"

namespace etendue {

/// A place at which a rendering looks for photons.
struct Importon {
    Vec3 p;
    ArrivalSide side;
    float importance;  ///< What a unit of radiance from there brings to the image.
    bool is_caustic;   ///< Whether it looks into the caustic map.
};

class PhotonImportance {
public:
    /// Densities within `radius`. Until set_floor() the floor is 0.
    PhotonImportance(std::span<const Importon> importons, float radius);
    /// The least importance of any photon.
    void set_floor(float floor) { floor_ = floor; }

    /// Importance per area where the photon is, of both maps if it is a caustic.
    float operator()(const MapPhoton& photon) const;

private:
    /// Tags of entries: the arrival side, and above it which map.
    static constexpr uint32_t kCaustic = 1u << 16;

    PointGrid grid_;
    float radius_, floor_ = 0;
};

}  // namespace etendue
