#pragma once
// Reader of Mitsuba's XML scenes, in the dialect of Mitsuba 0.4 to 0.6 (camelCase, version below 2.0.0) and in that of
// Mitsuba 2 and 3 (snake_case). The description uses the newer dialect for both. The reader checks elements and their
// nesting; the scene builder checks plug-ins and their parameters.

#include <string>
#include <string_view>

#include "description/scene_description.h"
#include "readers/read_options.h"

namespace etendue {

/// Reads a scene file and the files it includes. Throws SceneError.
SceneDescription read_mitsuba_xml(const std::string& file, const ReadOptions& options = {});

/// The same for text in memory. `file` is its name in messages, and relative file names are relative to its folder.
/// Files are opened through `options.read_file` only.
SceneDescription parse_mitsuba_xml(std::string_view text, const std::string& file,
                                   const ReadOptions& options = {});

}  // namespace etendue
