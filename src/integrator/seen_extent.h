#pragma once
// What the camera sees: the scale of distances between paths. The bounds of the scene may be far larger, where there is a
// wide ground or a distant object.

#include <vector>

#include "scene/scene.h"

namespace etendue {

/// Where a ray through the film ends, after the mirrors and the clear glass that it meets first.
struct SeenPoint {
    Vec3 p;
    /// Radius of a disc with the area of a pixel, projected to the surface as if mirrors and glass were flat.
    float pixel_radius;
};

/// The points that the rays of a grid over the film reach. Rays that leave the scene count where they last met a surface,
/// if they did. Independent of the crop.
std::vector<SeenPoint> seen_points(const Scene& scene);

/// Radius of the scene's bounds, but at most three times the median distance of the seen points from their middle. In scene
/// units; above 0.
float seen_radius(const Scene& scene);

}  // namespace etendue
