#pragma once
// Path lengths on the command line.

#include <string>

#include "pathspace/technique.h"

namespace etendue {

/// Parses a range of path lengths in edges: "2..8", or "2.." where `most` is kNoLimit. Throws std::runtime_error where
/// `text` has another form or a length lies outside [1, most].
PathSelection parse_lengths(const std::string& text, int most = PathSelection::kNoLimit);

}  // namespace etendue
