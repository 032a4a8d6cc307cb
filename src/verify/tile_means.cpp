#include "verify/tile_means.h"

namespace etendue {

std::vector<double> pixels_of_tiles(const TileGrid& grid) {
    std::vector<double> pixels(grid.tiles() + 1);
    for (uint64_t i = 0; i < grid.film.pixel_count(); ++i) ++pixels[grid.tile(i)];
    pixels.back() = double(grid.film.pixel_count());
    return pixels;
}

TileMeans tile_means(const std::vector<Rgb>& image, const TileGrid& grid) {
    TileMeans means(grid.tiles() + 1);
    for (uint64_t i = 0; i < image.size(); ++i)
        for (const size_t part : {grid.tile(i), grid.tiles()})
            for (int c = 0; c < 3; ++c) means[part][size_t(c)] += double(image[i][c]);
    const std::vector<double> pixels = pixels_of_tiles(grid);
    for (size_t i = 0; i < means.size(); ++i)
        for (double& v : means[i]) v /= pixels[i];
    return means;
}

void add_run(const TileMeans& means, TileMoments& moments) {
    for (size_t i = 0; i < means.size(); ++i)
        for (size_t k = 0; k < 3; ++k) moments[i][k].add(means[i][k]);
}

void compare_tiles(const TileMoments& method, const TileMoments& reference,
                   const std::vector<double>& effective_counts, const TileGrid& grid,
                   MethodReport& report, double rounding) {
    for (size_t i = 0; i < method.size(); ++i)
        for (size_t k = 0; k < 3; ++k)
            (i + 1 < method.size() ? report.tiles : report.image)
                .push_back(
                    WelchTest::of(method[i][k], reference[i][k], effective_counts[i], rounding));
    // Contributions too rare for some tiles may be missing from others, which then seem well sampled but are too dark.
    // If there are too many such tiles, no tile is tested.
    const std::vector<double> pixels = pixels_of_tiles(grid);
    double all = 0, untested = 0;
    for (size_t i = 0; i < report.tiles.size(); ++i) {
        const double light = pixels[i / 3] * report.tiles[i].reference.mean();
        all += light;
        if (!report.tiles[i].is_tested()) untested += light;
    }
    if (all > 0) report.untested_tiles = untested / all;
    if (report.untested_tiles > kTooMuchUntested) {
        report.untested_tiles = 1;
        for (WelchTest& t : report.tiles) t.effective_count = 0;
    }
}

}  // namespace etendue
