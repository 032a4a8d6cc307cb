#pragma once
// The integrator that a scene file names: by its own name or by one of Mitsuba's, with its own parameters and those of
// Mitsuba that have a counterpart.

#include <string>
#include <vector>

#include "integrator/integrator.h"

namespace etendue {

struct SceneIntegrator {
    IntegratorSpec spec;                ///< `auto` if the file names none.
    std::vector<std::string> warnings;  ///< What of the file's integrator is replaced or ignored.
};

/// Throws SceneError if the integrator or one of its parameters is unknown or invalid.
SceneIntegrator scene_integrator(const Scene& scene);

/// Its name, or "path" if it is invalid.
std::string name_of_integrator(const Scene& scene);

/// All integrators that scene files may name, with all parameters that they may have there.
std::vector<PluginInfo> scene_file_integrators();

/// Warnings of the scene, and those of its integrator if choose_integrator(scene, `integrator`) uses its parameters.
std::vector<std::string> warnings_of(const Scene& scene, const std::string& integrator = "");

}  // namespace etendue
