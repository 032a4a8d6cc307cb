#pragma once
// Area lights of a scene for Mitsuba 3.

#include <string>
#include <vector>

#include "description/scene_description.h"

namespace etendue {

/// Mitsuba 3 has no `power` of area lights, and they emit from the front alone: scales radiances, and adds the backs as
/// shapes of their own, close behind the fronts. The scene still means the same to etendue. Lights in shapegroups, which
/// neither has, are left out. Returns a line for each back and for each light that is left out.
std::vector<std::string> make_plain_area_lights(SceneDescription& scene);

}  // namespace etendue
