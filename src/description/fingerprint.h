#pragma once
// Recognises scenes and programs again, for results that are kept from one run to the next.

#include <cstdint>
#include <string>

#include "description/scene_description.h"

namespace etendue {

/// Hash of everything in a description that an image depends on, to the last bit, and of the bytes of every mesh, texture
/// and other file that it names. Where the scene was read from, and the warnings, do not count.
uint64_t scene_fingerprint(const SceneDescription& description);
/// Hash of the bytes of a file; that of no bytes where it cannot be read.
uint64_t file_fingerprint(const std::string& file);
/// Hash of the file with this code, since another build may render another image: the program, or a module of Python. A
/// module is read at the first call, since its file may be replaced later.
uint64_t program_fingerprint();

}  // namespace etendue
