#pragma once
// Search for the files that a scene names, and for the images that it holds in their place.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "description/params.h"

namespace etendue {

/// Path of the file named by string parameter `name`: an absolute path, or one relative to the first of the scene's
/// search paths that contains it. Throws SceneError with the folders searched and the nearest name found there.
std::string resolve_file(const Params& params, std::string_view name = "filename");

/// The image of the scene file itself whose index is the parameter "image"; nullptr where there is none, so that the image
/// is a file.
const EncodedImage* embedded_image(const Params& params);

/// The names under which a file is looked for: its own, and with '/' for '\', which scenes written on Windows have.
std::vector<std::string> spellings(const std::string& file);

/// Path of a file: `file` itself if it is absolute, otherwise in the first of the folders that has it, "." if there are no
/// folders. `searched`: gets the folders in which it is not.
std::optional<std::string> find_file(const std::string& file,
                                     const std::vector<std::string>& folders,
                                     std::vector<std::string>* searched = nullptr);

/// What follows the message about a missing file: "; did you mean "wood.png"?", or "". Names that differ in case alone
/// are near, and so are files of the same name in other folders than that of a path of another machine.
std::string near_file_hint(const std::string& file, const std::vector<std::string>& folders);

}  // namespace etendue
