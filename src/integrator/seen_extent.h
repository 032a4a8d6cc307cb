#pragma once
// What the camera sees: the scale of distances between paths. The bounds of the scene may be far larger, where there is a
// wide ground or a distant object.

#include "scene/scene.h"

namespace etendue {

/// Sizes of what the camera sees, from the points where rays through the film end after the mirrors and the clear glass that
/// they meet first.
struct SeenExtent {
    /// Radius of the scene's bounds, but at most three times the median distance of the points from their middle. In scene
    /// units; above 0.
    float radius;
    /// Median radius of a disc with the area of a pixel, projected to the surface as if mirrors and glass were flat. Infinite
    /// if no ray meets a surface.
    float pixel_radius;
};

/// From the rays of a grid over the film. Rays that leave the scene count where they last met a surface, if they did.
/// Independent of the crop.
SeenExtent seen_extent(const Scene& scene);

}  // namespace etendue
