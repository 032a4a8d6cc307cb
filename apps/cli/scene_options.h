#pragma once
// What every subcommand that reads a scene has in common.

#include <string>
#include <vector>

#include "integrator/integrator.h"
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
    std::string resolution, crop;

    void add_to(CLI::App& command);
    /// Without the scene file itself.
    void add_reading_options(CLI::App& command);
};

SceneDescription read_scene(const SceneOptions& options);
Scene build_scene(const SceneDescription& description, const SceneOptions& options);
/// Reads and builds the scene.
Scene load_scene(const SceneOptions& options);

/// The command line's integrator, or the scene's; parameters that are not given come from the scene's where it names the
/// same ones.
IntegratorSpec choose_integrator(const Scene& scene, const std::string& text);

/// Adds --sampler; `name` starts as the default of all subcommands.
void add_sampler_option(CLI::App& command, std::string& name, const std::string& more = "");
SamplerKind parse_sampler(const std::string& name);

}  // namespace etendue
