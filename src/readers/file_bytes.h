#pragma once
// Whole files as bytes, and the files of a scene.

#include <optional>
#include <string>
#include <string_view>

#include "description/source_location.h"
#include "readers/read_options.h"
#include "system/available_memory.h"

namespace etendue {

/// A file that is there, but cannot be read.
class UnreadableFile : public SceneError {
public:
    /// Why is that of errno.
    explicit UnreadableFile(const std::string& path);
};
/// Contents of a file. Throws UnreadableFile.
std::string read_file_bytes(const std::string& path);
/// Calls read(), which makes something of a file. Throws SceneError where it does not fit into memory.
template <class Read>
auto read_in_memory(const std::string& file, const Read& read) {
    return in_memory(read, [&](const char* why) { throw SceneError({file, 0}, why); });
}
/// Contents of a file that a scene names at `where`, which is where an error is reported; empty if there is none.
std::optional<std::string> read_named_file(const ReadOptions& options, const std::string& path,
                                           const SourceLocation& where);
/// The text without the mark of UTF-8 at its beginning. Throws SceneError where it begins with that of UTF-16.
std::string_view plain_text(std::string_view text, const std::string& file);
/// The folder of a file; "." for the current one.
std::string directory_of(const std::string& file);
/// The options, with `read_file` reading from disk where it is not set.
ReadOptions with_disk(ReadOptions options);
/// Contents of the scene file itself, unpacked where gzip packed it. Throws SceneError where it cannot be read.
std::string read_scene_bytes(const std::string& file, const ReadOptions& options);

}  // namespace etendue
