#pragma once
// What the camera sees first: the scale of distances between paths. The bounds of the scene may be far larger, where there
// is a wide ground or a distant object.

#include "scene/scene.h"

namespace etendue {

/// Calls use(ray, hit) for the surfaces that the rays of a grid over the film meet. Independent of the crop.
template <class Use>
void for_each_seen(const Scene& scene, const Use& use) {
    constexpr int kRays = 64;  // each way
    const FilmGeometry& film = scene.film();
    for (int row = 0; row < kRays; ++row)
        for (int column = 0; column < kRays; ++column) {
            const Vec2 point{(float(column) + 0.5f) * (float(film.width) / kRays),
                             (float(row) + 0.5f) * (float(film.height) / kRays)};
            const SensorRay ray = scene.sensor().sample_ray(point, {0.5f, 0.5f});
            SurfaceHit hit;
            Passage passage{scene.sensor_medium()};
            if (scene.intersect({ray.p, ray.d, kInf}, 0.5f, hit, passage)) use(ray, hit);
        }
}

/// Radius of the scene's bounds, but at most three times the median distance of these surfaces from their middle. In scene
/// units; above 0.
float seen_radius(const Scene& scene);

}  // namespace etendue
