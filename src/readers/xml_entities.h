#pragma once
// Entities that an XML file declares itself: <!DOCTYPE scene [<!ENTITY name "text">]>.

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "description/source_location.h"

namespace etendue {

/// `text` with `&name;` replaced by what the file declares for it; empty where it declares nothing. Line breaks within
/// values become blanks, so that lines keep their numbers. Throws SceneError for an entity in another file, which is not
/// read, for one that contains itself, and for those that grow too large. `line` gives the line of an offset in `text`.
std::optional<std::string> expand_entities(std::string_view text, const FileName& file,
                                           const std::function<int(size_t)>& line);

}  // namespace etendue
