#pragma once
// Picks paths of a short run as user paths ("resampling" of [Fan et al. 2005, §5]).

#include "mcmc/user_paths.h"

namespace etendue {

struct PickOptions {
    int count = 10;
    int x = 0, y = 0;  ///< Column and row of the pixel in the whole image.
    int length = 3;    ///< Length of the full paths in edges, at least 2.
    uint64_t samples = 200000;
    uint64_t seed = 0;
};

/// Light sub-paths of independent full paths, drawn in proportion to the contributions of the full paths to the pixel, each
/// at most once. Throws std::runtime_error if no path reaches the pixel.
std::vector<GivenPath> pick_paths(const Scene& scene, const PickOptions& options);

}  // namespace etendue
