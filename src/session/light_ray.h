#pragma once
// Rays for editing user paths: the surfaces that a ray hits, its continuation at mirrors and glass, and the points on
// mirrors and glass that connect two other points.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace etendue {

/// A surface point on a light ray.
struct RayPoint {
    Vec3 p, ng;
    float slack = 0;    ///< As SurfaceGeometry::slack.
    std::string shape;  ///< Name or number of the shape.
    bool emits = false;
    bool is_specular =
        false;  ///< A mirror or clear glass; light leaves it only in the directions of `events`.
    struct Event {
        uint8_t number;
        Vec3 direction;
        float weight;
    };
    std::vector<Event> events;
};

/// The points that the ray hits. At a specular surface, it continues by the event with the largest weight. The last point
/// is on the first surface that scatters in all directions, or is the point with the number `most`.
std::vector<RayPoint> trace_light(const Scene& scene, Vec3 origin, Vec3 direction, int most);

/// The eye ray through the centre of a film point, followed in the same way.
std::vector<RayPoint> trace_eye(const Scene& scene, Vec2 film, int most);

/// Moves the points on specular surfaces around `index` until they obey the laws of reflection and refraction, by at most
/// 20 steps of Newton's method on the direction of the light. The other points do not move.
struct Snapped {
    std::vector<Vec3> points;
    std::string problem;  ///< The reason if no points were found; otherwise empty.
};
Snapped snap(const Scene& scene, std::span<const Vec3> points, size_t index);

}  // namespace etendue
