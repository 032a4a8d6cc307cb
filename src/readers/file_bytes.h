#pragma once
// Whole files as bytes, and the files of a scene.

#include <string>
#include <string_view>

#include "description/source_location.h"
#include "readers/read_options.h"
#include "system/available_memory.h"

namespace etendue {

/// Contents of a file. Throws SceneError where it cannot be read.
std::string read_file_bytes(const std::string& path);
/// Calls read(), which makes something of a file. Throws SceneError where it does not fit into memory.
template <class Read>
auto read_in_memory(const std::string& file, const Read& read) {
    return in_memory(read, [&](const char* why) { throw SceneError({file, 0}, why); });
}
/// The text without the mark of UTF-8 at its beginning. Throws SceneError where it begins with that of UTF-16.
std::string_view plain_text(std::string_view text, const std::string& file);
/// The folder of a file; "." for the current one.
std::string directory_of(const std::string& file);
/// The options, with `read_file` reading from disk where it is not set.
ReadOptions with_disk(ReadOptions options);
/// Contents of the scene file itself, unpacked where gzip packed it. Throws SceneError where it cannot be read.
std::string read_scene_bytes(const std::string& file, const ReadOptions& options);

}  // namespace etendue
