#pragma once
// Search for the files that a scene names.

#include <string>
#include <string_view>

#include "description/params.h"

namespace etendue {

/// Path of the file named by string parameter `name`: an absolute path, or one relative to the first of the scene's
/// search paths that contains it. Throws SceneError with the folders searched and the nearest name found there.
std::string resolve_file(const Params& params, std::string_view name = "filename");

}  // namespace etendue
