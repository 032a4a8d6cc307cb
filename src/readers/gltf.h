#pragma once
// Reader of glTF 2.0 scenes, .gltf and .glb. Materials become `openpbr`, and everything else what Mitsuba 3 has for
// it. What has no counterpart is a warning, or an error where the file requires it.

#include <string>
#include <string_view>
#include <vector>

#include "description/scene_description.h"
#include "readers/read_options.h"

namespace etendue {

/// Reads a scene file and its buffers. Throws SceneError.
SceneDescription read_gltf(const std::string& file, const ReadOptions& options = {});

/// The same for bytes in memory: JSON, or the container of .glb. `file` is its name in messages, and relative file
/// names are relative to its folder. Files are opened through `options.read_file` only.
SceneDescription parse_gltf(std::string_view bytes, const std::string& file,
                            const ReadOptions& options = {});

/// Names of the extensions that are read, or have no effect on an image of light paths.
const std::vector<std::string>& gltf_extensions();

}  // namespace etendue
