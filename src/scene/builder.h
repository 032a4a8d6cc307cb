#pragma once
// From a SceneDescription to a Scene.

#include <optional>

#include "description/scene_description.h"
#include "scene/scene.h"

namespace etendue {

struct BuildOptions {
    bool lenient =
        false;  ///< Unknown plug-ins and parameters become warnings that name what was dropped.
    /// Image size and crop instead of the file's. A new size scales the file's crop away.
    std::optional<std::pair<int, int>> resolution;
    std::optional<std::array<int, 4>> crop;  ///< x, y, width, height
    AcceleratorOptions accelerator;
};

/// Throws SceneError.
Scene build_scene(const SceneDescription& description, const BuildOptions& options = {});

/// Tables of every plug-in the scene builder knows, by category in the order of `list`: shapes, BSDFs, textures,
/// emitters, media, sensors, films, filters, samplers, and the integrators' names that files may use.
std::vector<PluginInfo> scene_plugins();

}  // namespace etendue
