#pragma once
// Mean colours of the tiles of images and of the whole images, and their comparison.

#include <array>
#include <vector>

#include "verify/contribution_tally.h"
#include "verify/verify.h"

namespace etendue {

/// Mean colour of every tile, followed by that of the image.
using TileMeans = std::vector<std::array<double, 3>>;
/// Their mean and spread over independent images.
using TileMoments = std::vector<std::array<Moments, 3>>;

/// Number of pixels of every tile, followed by that of the image.
std::vector<double> pixels_of_tiles(const TileGrid& grid);
TileMeans tile_means(const std::vector<Rgb>& image, const TileGrid& grid);
void add_run(const TileMeans& means, TileMoments& moments);

/// Adds the comparisons of tiles and image to the report. `effective_counts` are those of WelchTest, of every tile and the
/// image, and so is `rounding`.
void compare_tiles(const TileMoments& method, const TileMoments& reference,
                   const std::vector<double>& effective_counts, const TileGrid& grid,
                   MethodReport& report, double rounding = WelchTest::kRounding);

}  // namespace etendue
