#pragma once
// Known or possible errors of an image, from the counters of its rendering.

#include <string>
#include <vector>

#include "pathspace/render_stats.h"

namespace etendue {

/// One sentence each; empty if nothing is wrong.
std::vector<std::string> warnings(const RenderStats& stats);

}  // namespace etendue
