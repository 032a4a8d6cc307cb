#pragma once
// The tags of an XML text, as far as a message about a wrong one needs them.

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace etendue {

/// What is wrong where an element ends in the wrong place: at the end tag whose name begins at `offset`, or at the end of
/// `text`. The text before must be well-formed. `line` gives the line of an offset.
std::string describe_wrong_end(std::string_view text, size_t offset,
                               const std::function<int(size_t)>& line);

}  // namespace etendue
