#pragma once
// Construction of a Scene from a SceneDescription.

#include <memory>
#include <optional>

#include "description/params.h"
#include "scene/scene.h"

namespace etendue {

class BuiltParts;

struct BuildOptions {
    /// Unknown plug-ins and parameters become warnings that name what was left out.
    bool lenient = false;
    /// Width and height of the image, instead of the file's size and crop.
    std::optional<std::pair<int, int>> resolution;
    std::optional<std::array<int, 4>> crop;  ///< x, y, width, height
    std::string sensor;                      ///< Number (from 0) or id; empty: the first.
    AcceleratorOptions accelerator;
    /// Threads that read files and build the hierarchy of rays; 0: available_threads().
    int threads = 0;
    /// What is kept of the scene of the description before an edit, see build_scene_again(); nullptr: nothing.
    std::shared_ptr<const BuiltParts> earlier = nullptr;
};

/// Throws SceneError where the description is invalid.
Scene build_scene(const SceneDescription& description, const BuildOptions& options = {});

/// A scene, and what the next one can use of it.
struct BuiltScene {
    Scene scene;
    std::shared_ptr<const BuiltParts> parts;
};
/// The same, for descriptions that are edited and built again: meshes, images and the hierarchy of rays that an edit has not
/// changed are shared with `options.earlier`. The scene is that of build_scene().
BuiltScene build_scene_again(const SceneDescription& description, const BuildOptions& options = {});

/// Tables of all plug-ins of the scene builder by category, in the order of `etendue list`: shapes, BSDFs, textures,
/// emitters, media, sensors, films, filters and samplers.
std::vector<PluginInfo> scene_plugins();

}  // namespace etendue
