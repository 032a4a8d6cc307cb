#pragma once
// Stages of Universal Scene Description, which the Python package reads by Pixar's library.

#include <string>

#include "description/scene_description.h"
#include "readers/read_options.h"

namespace etendue {

/// Runs `python3 -m etendue.usd`, of the virtual environment VIRTUAL_ENV or else of PATH, and reads what it writes to a
/// temporary folder, of which nothing is needed afterwards. Of `options.defines`, "camera", "time", "subdivision" and
/// "purpose" are options of that command, and "/PRIM:SET" chooses a variant.
///
/// Throws std::runtime_error, which says how to get what is missing, and with the messages of the command.
SceneDescription read_usd(const std::string& file, const ReadOptions& options = {});

/// Makes the description independent of the files in `folder`: their meshes and images become parts of it. Names of other
/// files are made relative to `base`, the folder of the scene.
void take_in_files(SceneDescription& scene, const std::string& folder, const std::string& base);

}  // namespace etendue
