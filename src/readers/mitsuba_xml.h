#pragma once
// Reader of Mitsuba's XML scenes, in the dialect of Mitsuba 0.4 to 0.6 (camelCase, version below
// 2.0.0) and in that of Mitsuba 2 and 3 (snake_case). Whatever the dialect, the description speaks
// the newer one. The reader knows elements and nesting; plug-ins and their parameters are the scene
// builder's.

#include <string>
#include <string_view>

#include "description/scene_description.h"
#include "readers/read_options.h"

namespace etendue {

/// Reads a scene file and the files it includes. Throws SceneError.
SceneDescription read_mitsuba_xml(const std::string& file, const ReadOptions& options = {});

/// The same for text in memory; `file` names it in messages and tells where relative file names
/// start. No file is opened but through `options.read_file`.
SceneDescription parse_mitsuba_xml(std::string_view text, const std::string& file,
                                   const ReadOptions& options = {});

}  // namespace etendue
