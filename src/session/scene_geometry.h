#pragma once
// Shapes as triangles, for drawing only: rays are traced on the true geometry.

#include <cstdint>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace etendue {

struct DrawnShape {
    uint32_t shape = 0;  ///< Index in Scene::shapes().
    std::string name;
    Bounds3 bounds;
    Rgb color;  ///< About its reflectance.
    bool emits = false;
    bool is_specular = false;         ///< A mirror or clear glass.
    std::vector<uint16_t> positions;  ///< x, y, z in 1/65535 of the bounds.
    std::vector<uint32_t> triangles;
};

/// All shapes, those with many triangles simplified until there are at most `most_triangles` in all. Shapes that are
/// only visible through instances are drawn once, in their own place.
std::vector<DrawnShape> drawn_shapes(const Scene& scene, size_t most_triangles);

}  // namespace etendue
