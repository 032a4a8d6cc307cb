#pragma once
// Path lengths on the command line.

#include <string>

#include "pathspace/technique.h"

namespace etendue {

/// Of the form 2..8, in edges; also 2.. where there is no longest. Throws std::runtime_error where `text` has not this
/// form, or lengths beyond `most`.
PathSelection parse_lengths(const std::string& text, int most = PathSelection::kNoLimit);

}  // namespace etendue
