#pragma once
// Shapes as the page reads them.

#include <string>
#include <vector>

#include "session/scene_geometry.h"

namespace etendue {

/// 4 bytes: the length of the JSON text; the text, filled up with spaces to whole 4 bytes; positions, indices and places.
std::string encode(const std::vector<DrawnShape>& shapes);

}  // namespace etendue
