#pragma once
// Recognises whether a file was changed.

#include <string>

namespace etendue {

/// Time of the last change, size and identity of a file; empty if there is none.
std::string file_version(const std::string& file);

}  // namespace etendue
