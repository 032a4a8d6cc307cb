#pragma once
// Scene files of any format.

#include <stdexcept>
#include <string>

#include "description/scene_description.h"
#include "readers/read_options.h"

namespace etendue {

/// Thrown where values are given for parameters of a format that has none.
class UnusedDefines : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Whether a name has the ending of a kind of scene file that can be read, also behind ".gz".
bool is_scene_file_name(const std::string& file);

/// Throws std::runtime_error where there is no such file.
void check_scene_file(const std::string& file);

/// Reads a scene file with the reader of its extension, also behind ".gz"; stages of USD by read_usd(). Throws
/// std::runtime_error where there is no such file or no such reader, and SceneError where the contents are invalid.
SceneDescription read_scene_file(const std::string& file, const ReadOptions& options = {});

}  // namespace etendue
