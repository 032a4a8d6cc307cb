#pragma once

#include <string>

namespace etendue {

/// Throws std::runtime_error where two outputs of a command, which are named in words, are one file that would be written
/// twice. Outputs that are not wanted have no name. Devices can be written twice.
void refuse_same_file(const char* one, const std::string& file, const char* other,
                      const std::string& other_file);

}  // namespace etendue
