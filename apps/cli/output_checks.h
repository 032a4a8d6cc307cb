#pragma once

#include <string>

namespace etendue {

/// Throws std::runtime_error where two files of a command, which are named in words, are one that an output would replace.
/// Files that are not wanted have no name. Devices can be written twice.
void refuse_same_file(const char* one, const std::string& file, const char* other,
                      const std::string& other_file);

/// The same where the output is the file of user paths that an integrator with parameters names.
void refuse_user_paths(const std::string& integrator, const char* output, const std::string& file);

/// Whether a checkpoint of this name would replace another one. Throws std::runtime_error if it would replace any other
/// file that is not empty.
bool replaces_checkpoint(const std::string& file);

}  // namespace etendue
