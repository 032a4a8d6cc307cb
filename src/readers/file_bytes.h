#pragma once
// Whole files as bytes.

#include <string>

namespace etendue {

/// Contents of a file. Throws SceneError where it cannot be read.
std::string read_file_bytes(const std::string& path);

}  // namespace etendue
