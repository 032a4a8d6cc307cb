#pragma once
// Renderings as means over tiles with their spread, and tests that compare two of them.

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <vector>

#include "math/statistics.h"
#include "render/renderer.h"
#include "spec_of.h"

namespace etendue::test {

/// Means of tiles × tiles parts of the image by channel, followed by those of the whole image.
struct Tiles {
    int across = 1;
    std::vector<Moments> values;  ///< Of channel c of part i: [3 i + c].

    explicit Tiles(int tiles) : across(tiles), values(size_t(tiles * tiles + 1) * 3) {}
    int parts() const { return across * across + 1; }
};

inline std::vector<double> tile_means(const std::vector<Rgb>& pixels, const FilmGeometry& g,
                                      int tiles) {
    const size_t parts = size_t(tiles * tiles);
    std::vector<double> sums((parts + 1) * 3), counts(parts + 1);
    for (size_t i = 0; i < pixels.size(); ++i) {
        const int x = int(i) % g.crop_width, y = int(i) / g.crop_width;
        const size_t tile = size_t(y * tiles / g.crop_height * tiles + x * tiles / g.crop_width);
        for (const size_t part : {tile, parts}) {
            ++counts[part];
            for (int c = 0; c < 3; ++c) sums[part * 3 + size_t(c)] += double(pixels[i][c]);
        }
    }
    for (size_t i = 0; i < sums.size(); ++i) sums[i] /= counts[i / 3];
    return sums;
}

struct TileOptions {
    uint64_t passes;
    int tiles = 4;
    uint64_t seed = 1;
    int batches = 32;
    int shortest = 1;  ///< Paths of fewer edges are left out.
    FilterMode filter_mode = RenderSettings().filter_mode;
};

/// The integrator's image from `passes` passes; their spread is measured between batches of consecutive ones.
inline Tiles render_tiles(const Scene& scene, const std::string& integrator, const TileOptions& o) {
    RenderSettings settings;
    settings.integrator = spec_of(scene, integrator);
    settings.seed = o.seed;
    settings.threads = 1;
    settings.spp = o.passes;
    settings.shown.shortest = o.shortest;
    settings.filter_mode = o.filter_mode;
    Renderer renderer(scene, settings);
    Tiles tiles(o.tiles);
    std::vector<double> before(tiles.values.size());
    const uint64_t batch = o.passes / uint64_t(o.batches);
    const std::atomic<bool> interrupted{false};
    renderer.run(
        [&](const Progress& p) {
            if (p.passes % batch != 0) return;
            const std::vector<double> mean =
                tile_means(renderer.film().image(), scene.film(), o.tiles);
            for (size_t i = 0; i < mean.size(); ++i) {
                const double sum = mean[i] * double(p.passes);
                tiles.values[i].add((sum - before[i]) / double(batch));
                before[i] = sum;
            }
        },
        interrupted);
    EXPECT_EQ(renderer.stats().rejected, 0u) << integrator;
    return tiles;
}

/// A known image: `radiance(x, y)` at film points in pixels, averaged over pixels.
template <class Radiance>
Tiles exact_tiles(const FilmGeometry& g, int tiles, const Radiance& radiance) {
    constexpr int kPoints = 8;
    std::vector<Rgb> pixels;
    for (uint64_t i = 0; i < g.pixel_count(); ++i) {
        const Vec2 center = g.pixel_center(i);
        Rgb sum;
        for (int j = 0; j < kPoints * kPoints; ++j)
            sum += radiance(center.x - 0.5f + (float(j % kPoints) + 0.5f) / kPoints,
                            center.y - 0.5f + (float(j / kPoints) + 0.5f) / kPoints);
        pixels.push_back(sum * (1.0f / (kPoints * kPoints)));
    }
    Tiles out(tiles);
    const std::vector<double> means = tile_means(pixels, g, tiles);
    for (size_t i = 0; i < means.size(); ++i) out.values[i] = Moments::exact(means[i]);
    return out;
}

/// Relative error of a mean that is attributed to rounding.
inline constexpr double kRounding = 1e-4;

/// Welch's test of every tile and of the whole image, by channel; a false alarm in 0.01 % of all calls with fresh
/// seeds, and so in 1 % of all suites of a hundred calls. The test must be able to see a relative error of `resolution`
/// of the image's mean: four standard errors have to be less.
inline void expect_same_image(const Tiles& a, const Tiles& b, double resolution,
                              const std::string& what) {
    ASSERT_EQ(a.across, b.across);
    const double level = sidak(1e-4, int(a.values.size()));
    const size_t whole = size_t(a.parts() - 1) * 3;
    size_t different = 0, worst = 0;
    double lowest = 2, seen = 0;
    for (size_t i = 0; i < a.values.size(); ++i) {
        const Moments &x = a.values[i], &y = b.values[i];
        const double p = welch_p(x, y, kRounding * std::fabs(y.mean()));
        different += p < level;
        if (p < lowest) lowest = p, worst = i;
        if (i >= whole && y.mean() != 0)
            seen = std::fmax(seen, 4 * std::sqrt(x.squared_error() + y.squared_error()) /
                                       std::fabs(y.mean()));
    }
    const Moments &x = a.values[worst], &y = b.values[worst];
    EXPECT_EQ(different, 0u) << what << ": of " << a.values.size() << " means; the worst, of "
                             << (worst < whole ? "tile " + std::to_string(worst / 3) : "the image")
                             << ", channel " << worst % 3 << ": " << x.mean() << " against "
                             << y.mean() << ", ratio " << x.mean() / y.mean() << ", p = " << lowest
                             << "; of the image: " << a.values[whole].mean() << " against "
                             << b.values[whole].mean() << ", ratio "
                             << a.values[whole].mean() / b.values[whole].mean();
    EXPECT_LT(seen, resolution) << what << ": too few samples";
}

}  // namespace etendue::test
