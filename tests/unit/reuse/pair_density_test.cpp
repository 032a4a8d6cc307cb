// The density of partners against the number of them.

#include "reuse/pair_density.h"

#include <gtest/gtest.h>

#include "random.h"
#include "reuse/point_grid.h"

namespace etendue {
namespace {

constexpr double kCorrelation = 0.2;

double share(const PairDensity& density, Vec3 p) {
    return pair_share(density.pair_level(p));
}

TEST(PairDensity, HasTheSmallestShareBeforeLearning) {
    EXPECT_LT(share(PairDensity(), {0, 0, 0}), 1e-4);
}

/// Of points spread evenly over a floor, half of it with four times as many.
TEST(PairDensity, IsThatOfThePlane) {
    constexpr float kRadius = 0.05f;
    constexpr int kPoints = 20000;  // a unit of area of the sparser half
    testing::Random random(5);
    std::vector<PointGrid::Entry> points;
    for (int i = 0; i < kPoints; ++i)
        points.push_back({{random.between(-1, 0), random.next_1d(), 0.01f}, 0});
    for (int i = 0; i < 4 * kPoints; ++i)
        points.push_back({{random.next_1d(), random.next_1d(), 0.01f}, 0});
    PointGrid grid;
    grid.build(points, 1.4f * kRadius);
    const PairDensity density(grid.counts(), kRadius, kCorrelation);
    double partners[2] = {};
    constexpr int kPlaces = 2000;
    for (int i = 0; i < kPlaces; ++i)
        for (const int half : {0, 1})
            partners[half] += (1 / share(density, {random.between(-0.9f, -0.1f) + float(half),
                                                   random.between(0.1f, 0.9f), 0.01f}) -
                               1) /
                              kCorrelation;
    const double expected = double(kPi) * double(kRadius) * double(kRadius) * kPoints;
    EXPECT_NEAR(partners[0] / kPlaces / expected, 1, 0.1);
    EXPECT_NEAR(partners[1] / kPlaces / (4 * expected), 1, 0.1);
    EXPECT_GT(share(density, {0, 0.5f, 5}), 0.9 / (1 + 4 * kCorrelation * expected));
}

}  // namespace
}  // namespace etendue
