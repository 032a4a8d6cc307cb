#pragma once
// Options and steps shared by every subcommand that reads a scene.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sampler/sampler.h"
#include "scene/scene.h"

namespace CLI {
class App;
}

namespace etendue {

struct SceneOptions {
    std::string file;
    std::vector<std::string> defines;  ///< name=value
    bool lenient = false;
    bool watertight = false;
    std::string resolution, crop, sensor;
    /// Limit of this process, such as 4G, from the parsing of the command line on; if empty, what the machine has.
    std::string memory;
    int threads = 0;  ///< Of BuildOptions; set by commands that have --threads.

    void add_to(CLI::App& command);
    /// All of these options except the scene file.
    void add_reading_options(CLI::App& command);
};

SceneDescription read_scene(const SceneOptions& options);
Scene build_scene(const SceneDescription& description, const SceneOptions& options);
/// Reads and builds the scene.
Scene load_scene(const SceneOptions& options);

/// Adds --sampler, whose default is the value of `sampler`. `more` is appended to the option's description.
void add_sampler_option(CLI::App& command, SamplerKind& sampler, const std::string& more = "");

}  // namespace etendue
