#pragma once
// Files that gzip packed.

#include <string>
#include <string_view>

namespace etendue {

/// Whether the bytes begin as those of gzip do.
bool is_gzip(std::string_view bytes);
/// What was packed. Throws SceneError, which names `file`, where the data are damaged or too large.
std::string unpack_gzip(std::string_view bytes, const std::string& file);

}  // namespace etendue
