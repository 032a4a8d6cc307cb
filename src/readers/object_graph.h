#pragma once
// Checks of a complete description. They make recursive traversal of its objects safe and quick; every reader calls them.

#include "description/scene_description.h"

namespace etendue {

/// Throws SceneError where an object contains itself, objects are nested more than `deepest` levels deep, or a traversal
/// would visit one object far more often than the file names it.
void check_object_graph(const SceneDescription& scene, int deepest);

}  // namespace etendue
