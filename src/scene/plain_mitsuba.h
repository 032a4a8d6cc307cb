#pragma once
// Turns a description into one that has only plug-ins and parameters of Mitsuba 3, so that it can be written for it.

#include <string>
#include <vector>

#include "description/scene_description.h"

namespace etendue {

/// Replaces what Mitsuba 3 does not have by what means the same there, and where there is nothing, by what comes near
/// to it. Textures that it lacks become images. Returns one line for each replacement that changes the image, with its
/// place in the scene. Throws SceneError where a parameter has not the type that its plug-in takes.
std::vector<std::string> make_plain_mitsuba(SceneDescription& scene);

}  // namespace etendue
