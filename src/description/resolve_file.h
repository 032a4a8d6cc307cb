#pragma once
// Where the files that a scene names are.

#include <string>
#include <string_view>

#include "description/params.h"

namespace etendue {

/// Path of the file that string parameter `name` of the object names: absolute, or in the first of the scene's search
/// paths that has it. Throws SceneError, telling where it looked and the nearest name there.
std::string resolve_file(const Params& params, std::string_view name = "filename");

}  // namespace etendue
