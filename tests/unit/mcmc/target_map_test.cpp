#include "mcmc/target_map.h"

#include <cmath>

#include <gtest/gtest.h>

namespace etendue {
namespace {

constexpr int kWidth = 128, kHeight = 96;

/// Of `per_pixel` samples in each pixel, with the luminance `value(x, y)`.
template <class Value>
TargetMap map_of(const FilmGeometry& g, uint64_t per_pixel, const Value& value) {
    const uint64_t samples = per_pixel * g.pixel_count();
    TargetMap map(g, samples);
    for (int y = g.crop_y; y < g.crop_y + g.crop_height; ++y)
        for (int x = g.crop_x; x < g.crop_x + g.crop_width; ++x)
            for (uint64_t i = 0; i < per_pixel; ++i)
                // A sample of the whole film is the pixel's value times the film's area.
                map.add({float(x) + 0.5f, float(y) + 0.5f}, value(x, y) * double(g.pixel_count()));
    map.learn();
    return map;
}

FilmGeometry whole() {
    return {kWidth, kHeight, 0, 0, kWidth, kHeight};
}

TEST(TargetMap, IsOneBeforeItHasLearned) {
    EXPECT_EQ(TargetMap(whole(), 1000)({64, 48}), 1);
}

TEST(TargetMap, IsTheReciprocalLuminanceWithAFloor) {
    for (const double L : {1e-6, 1.0, 1e6}) {
        const TargetMap map = map_of(whole(), 1, [&](int, int) { return L; });
        for (const Vec2 film : {Vec2{0, 0}, Vec2{64, 48}, Vec2{130, -2}})
            EXPECT_NEAR(map(film) * L * std::sqrt(1.01), 1, 1e-6);
    }
}

TEST(TargetMap, DarkPixelsNearABrightSpotHaveTheirOwnWeight) {
    // With one sample for each pixel, tiles are 8 pixels wide, and L depends on two tiles on each side at most.
    const auto value = [](int x, int y) { return x < 16 && y < 16 ? 1000.0 : 1.0; };
    const TargetMap map = map_of(whole(), 1, value);
    const double mean = 1 + 999 * 256.0 / (kWidth * kHeight);
    EXPECT_NEAR(map({4, 4}), 1 / std::hypot(1000, 0.1 * mean), 1e-4);
    EXPECT_NEAR(map({36, 36}), 1 / std::hypot(1, 0.1 * mean), 1e-3);
    // Next to the spot, L is nearer to that of the dark side.
    EXPECT_LT(1 / map({20, 8}), 150);
}

TEST(TargetMap, TilesAreWiderWithFewerSamples) {
    // A bright row reaches as far as the tiles.
    const auto width = [](uint64_t samples) {
        TargetMap map(whole(), samples);
        map.add({64, 0.5f}, 1000);
        map.learn();
        int rows = 0;
        while (rows < kHeight && map({64, float(rows) + 0.5f}) < map({64, kHeight - 0.5f})) ++rows;
        return rows;
    };
    EXPECT_GT(width(whole().pixel_count() / 4), width(whole().pixel_count()));
    EXPECT_GT(width(whole().pixel_count()), width(whole().pixel_count() * 16));
}

TEST(TargetMap, CountsFromTheCrop) {
    const FilmGeometry crop{kWidth, kHeight, 40, 24, 64, 48};
    const TargetMap map = map_of(crop, 1, [](int x, int) { return x < 72 ? 1.0 : 4.0; });
    EXPECT_NEAR(map({44, 30}), 1 / std::hypot(1, 0.25), 1e-6);
    EXPECT_NEAR(map({100, 60}), 1 / std::hypot(4, 0.25), 1e-6);
}

TEST(TargetMap, SavesAndLoads) {
    const TargetMap map = map_of(whole(), 2, [](int x, int y) { return 1.0 + x * y; });
    LearnedState state;
    map.save(state);
    LearnedState from(state.bytes());
    TargetMap loaded;
    loaded.load(from);
    for (const Vec2 film : {Vec2{0, 0}, Vec2{64, 48}, Vec2{127, 95}})
        EXPECT_EQ(loaded(film), map(film));
}

}  // namespace
}  // namespace etendue
