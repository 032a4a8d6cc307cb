#pragma once
// Recognises scenes and programs again, for results that are kept from one run to the next.

#include <cstdint>
#include <string>

#include "description/scene_description.h"

namespace etendue {

/// Hash of everything in a description that an image depends on, to the last bit, and of the bytes of every mesh, texture
/// and other file that it names. Where the scene was read from, and the warnings, do not count.
uint64_t scene_fingerprint(const SceneDescription& description);
/// Hash of the file with the program, since another build may render another image.
uint64_t program_fingerprint(const std::string& file = "/proc/self/exe");

}  // namespace etendue
