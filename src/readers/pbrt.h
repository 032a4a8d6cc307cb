#pragma once
// Reader of pbrt scenes, of pbrt-v3 and pbrt-v4. It translates names, parameters and conventions into those of Mitsuba 3,
// which the description speaks; what the scene builder has no word for is refused here, by name. A file is of pbrt-v3
// where it ends with WorldEnd or has the film "image".

#include <string>
#include <string_view>
#include <vector>

#include "description/params.h"
#include "readers/read_options.h"

namespace etendue {

/// Reads a scene file, which may be packed by gzip, and the files it includes. Throws SceneError.
SceneDescription read_pbrt(const std::string& file, const ReadOptions& options = {});

/// The same for text in memory; `file` names it in messages and tells where relative file names start. No file is opened
/// but through `options.read_file`.
SceneDescription parse_pbrt(std::string_view text, const std::string& file,
                            const ReadOptions& options = {});

/// Tables of what pbrt scenes may name, by category: "pbrt-shape", "pbrt-material", ...
const std::vector<PluginInfo>& pbrt_plugins();

}  // namespace etendue
