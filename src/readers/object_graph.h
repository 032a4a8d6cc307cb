#pragma once
// Checks of a finished description that every reader owes to those who walk it recursively.

#include "description/scene_description.h"

namespace etendue {

/// Throws SceneError where an object contains itself, or where objects stand more than `deepest`
/// levels deep.
void check_object_graph(const SceneDescription& scene, int deepest);

}  // namespace etendue
