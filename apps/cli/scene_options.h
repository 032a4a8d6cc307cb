#pragma once
// What every subcommand that reads a scene has in common.

#include <string>
#include <vector>

#include "scene/scene.h"

namespace CLI {
class App;
}

namespace etendue {

struct SceneOptions {
    std::string file;
    std::vector<std::string> defines;  ///< name=value
    bool lenient = false;
    std::string resolution, crop;

    void add_to(CLI::App& command);
};

/// Reads and builds the scene.
Scene load_scene(const SceneOptions& options);

}  // namespace etendue
