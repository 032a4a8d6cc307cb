#pragma once
// Shapes as triangles, for drawing only: rays are traced on the true geometry.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace etendue {

struct DrawnShape {
    uint32_t shape = 0;  ///< Index in Scene::shapes().
    std::string name;
    Bounds3 bounds;  ///< In the space of the shape.
    Rgb color;       ///< About its reflectance.
    bool emits = false;
    bool is_specular = false;         ///< A mirror or clear glass.
    std::vector<uint16_t> positions;  ///< x, y, z in 1/65535 of the bounds.
    std::vector<uint32_t> triangles;
    /// About a sixteenth of the triangles, of the same vertices, for views that move. Empty where there are few.
    std::vector<uint32_t> coarse_triangles;
    using Place =
        std::array<float, 12>;  ///< The first three rows of a matrix, one after the other.
    std::vector<Place> places;  ///< Maps to world space, one for each time that the shape is drawn.
};

/// Limits of the instances that are drawn of one shape, and of all.
inline constexpr size_t kMostPlaces = 20'000, kMostPlacesInAll = 200'000;

/// All shapes, those with many triangles simplified until there are at most `most_triangles` in all, and four times as
/// many with instances. Where there are more shapes than that, the smallest are left out, and some of more instances than
/// the limits.
std::vector<DrawnShape> drawn_shapes(const Scene& scene, size_t most_triangles);

}  // namespace etendue
