// The density of weights on surfaces.

#include "guide/placed_density.h"

#include <gtest/gtest.h>

#include "math/hash.h"

namespace etendue::test {
namespace {

/// Weights of 0.01 each at random places of a square with sides of 2 at z = 0: a hundred per area.
std::vector<PlacedWeight> square(Vec3 n) {
    std::vector<PlacedWeight> weights;
    for (uint32_t i = 0; i < 40'000; ++i) {
        const auto u = [&](uint32_t k) {
            return 2 * to_unit_float(uint32_t(hash_combine(i, k))) - 1;
        };
        weights.push_back({{u(0), u(1), 0}, n, 0.01f});
    }
    return weights;
}

TEST(PlacedDensity, IsTheSumOfWeightsOverTheArea) {
    const PlacedDensity density(square({0, 0, 1}));
    double mean = 0;
    constexpr int kSteps = 40;
    for (int i = 0; i < kSteps; ++i)
        for (int k = 0; k < kSteps; ++k)
            mean +=
                density({2 * (float(i) + 0.5f) / kSteps - 1, 2 * (float(k) + 0.5f) / kSteps - 1, 0},
                        {0, 0, 1});
    // It is 0 between the boxes.
    EXPECT_NEAR(mean / (kSteps * kSteps), 100, 10);
}

TEST(PlacedDensity, TellsTheSidesOfAWallApart) {
    const PlacedDensity density(square({0, 0, 1}));
    EXPECT_EQ(density({0.1f, 0.2f, 0}, {0, 0, -1}), 0);
}

/// Normals of tessellated walls, or of transformed ones, differ from an axis by rounding errors.
TEST(PlacedDensity, SmallDeviationsOfNormalsDoNotMatter) {
    std::vector<PlacedWeight> weights = square({0, 0, 1});
    for (size_t i = 0; i < weights.size(); ++i)
        weights[i].n = {i & 1 ? 1e-7f : -1e-7f, i & 2 ? 1e-7f : -1e-7f, 1};
    const PlacedDensity density(weights), plain(square({0, 0, 1}));
    for (const float x : {-0.51f, 0.13f, 0.72f})
        EXPECT_EQ(density({x, 0.2f, 0}, {1e-8f, -1e-8f, 1}), plain({x, 0.2f, 0}, {0, 0, 1}));
}

TEST(PlacedDensity, LightPassesThroughSurfacesWithoutNormal) {
    const PlacedDensity density(square({}));
    EXPECT_NEAR(density({0.1f, 0.2f, 0}, {}), 100, 50);
    EXPECT_EQ(density({0.1f, 0.2f, 0}, {0, 0, 1}), 0) << "another surface";
}

TEST(PlacedDensity, InfiniteWeightsDoNotCount) {
    std::vector<PlacedWeight> weights = square({0, 0, 1});
    weights[0].weight = kInf;
    const PlacedDensity density(weights);
    EXPECT_LT(density(weights[0].p, {0, 0, 1}), 200);
}

TEST(PlacedDensity, IsZeroAwayFromTheWeights) {
    const PlacedDensity density(square({0, 0, 1}));
    EXPECT_EQ(density({1.1f, 0.2f, 0}, {0, 0, 1}), 0);
    EXPECT_EQ(density({0.1f, 0.2f, 0.1f}, {0, 0, 1}), 0);
    EXPECT_EQ(PlacedDensity({})({0, 0, 0}, {0, 0, 1}), 0);
}

TEST(PlacedDensity, TakesCoincidentWeights) {
    const PlacedDensity density(std::vector<PlacedWeight>(1000, {{1, 2, 3}, {0, 0, 1}, 1}));
    EXPECT_EQ(density({1, 2, 3}, {0, 0, 1}), 0);  // They cover no area.
}

}  // namespace
}  // namespace etendue::test
