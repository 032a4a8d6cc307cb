#pragma once
// Checks of a complete description. They make recursive traversal of its objects safe; every reader calls them.

#include "description/scene_description.h"

namespace etendue {

/// Throws SceneError where an object contains itself or objects are nested more than `deepest` levels deep.
void check_object_graph(const SceneDescription& scene, int deepest);

}  // namespace etendue
