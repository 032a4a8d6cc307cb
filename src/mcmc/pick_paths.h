#pragma once
// Picks good paths of a short run as user paths ("resampling" of Fan, Chenney & Lai 2005, §5).

#include "mcmc/user_paths.h"

namespace etendue {

struct PickOptions {
    int count = 10;
    int x = 0, y = 0;  ///< The pixel, within the whole image.
    int length = 3;    ///< Of the full paths, in edges; at least 2.
    uint64_t samples = 200000;
    uint64_t seed = 0;
};

/// Light sub-paths of independent full paths, in proportion to what these bring to the pixel, each but once. Throws
/// std::runtime_error where nothing was found.
std::vector<GivenPath> pick_paths(const Scene& scene, const PickOptions& options);

}  // namespace etendue
