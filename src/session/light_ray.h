#pragma once
// Rays through the scene for those who draw light paths: what a ray meets, where mirrors and glass send it, and the
// points of mirrors and glass that join two others.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace etendue {

/// A surface point on a light ray.
struct RayPoint {
    Vec3 p, ng;
    std::string shape;  ///< Its name, or number.
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

/// The ray and, after every specular surface, its continuation by the event with the largest weight; ends with the
/// first surface that scatters in all directions. At most `most` points.
std::vector<RayPoint> trace_light(const Scene& scene, Vec3 origin, Vec3 direction, int most);

/// The eye ray through the centre of a film point, followed in the same way.
std::vector<RayPoint> trace_eye(const Scene& scene, Vec2 film, int most);

/// The points with those of the specular surfaces around `index` moved so that they obey the laws of reflection and
/// refraction; the other points stay. At most 20 steps of Newton's method on the direction of the light.
struct Snapped {
    std::vector<Vec3> points;
    std::string problem;  ///< Empty where points were found.
};
Snapped snap(const Scene& scene, std::span<const Vec3> points, size_t index);

}  // namespace etendue
