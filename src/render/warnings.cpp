#include "render/warnings.h"

#include <fmt/format.h>

namespace etendue {

std::vector<std::string> warnings(const RenderStats& stats) {
    std::vector<std::string> all;
    if (stats.rejected > 0)
        all.push_back(
            fmt::format("{} contributions were not finite and were left out", stats.rejected));
    if (stats.runaways > 0)
        all.push_back(
            fmt::format("{} pairs of vertices were abandoned after too many trials: their light is "
                        "missing, and the image is darker than it should be",
                        stats.runaways));
    if (stats.bounds_exceeded > 0)
        all.push_back(fmt::format(
            "{} trials met a density above its assumed bound: the image may be biased there; "
            "please report the scene",
            stats.bounds_exceeded));
    return all;
}

}  // namespace etendue
