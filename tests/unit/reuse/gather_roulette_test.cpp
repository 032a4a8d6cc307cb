// Expected contributions of pairs, by the lengths of their sub-paths.

#include "reuse/gather_roulette.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace etendue {
namespace {

GatherTotals totals(const GatherSums& sums) {
    std::vector<std::unique_ptr<PassSums>> workers;
    workers.push_back(std::make_unique<GatherSums>(sums));
    GatherTotals t;
    t.add(workers);
    return t;
}

float worth_after(float ratio, int s, int t) {
    GatherSums stats;
    for (int i = 0; i < 100000; ++i)
        GatherRoulette::observe(3, 4, i % 2 == 0 ? ratio : 0.0f, stats);
    GatherRoulette worth;
    worth.learn(totals(stats));
    return worth.of(s, t);
}

float before_any() {
    GatherRoulette worth;
    worth.learn({});
    return worth.of(3, 4);
}

TEST(GatherRoulette, IsTheRootMeanSquareOfTheRatios) {
    const float one = worth_after(1, 3, 4);
    EXPECT_NEAR(worth_after(0.1f, 3, 4) / one, 0.1f, 0.001f);
    // Half of the ratios are zero; before any join the ratio is 1/8.
    EXPECT_NEAR(one / before_any(), std::sqrt(0.5f) / 0.125f, 0.01f);
}

TEST(GatherRoulette, CountsNanAsZero) {
    GatherSums none, nan;
    GatherRoulette::observe(3, 4, 0, none);
    GatherRoulette::observe(3, 4, std::numeric_limits<float>::quiet_NaN(), nan);
    GatherRoulette a, b;
    a.learn(totals(none));
    b.learn(totals(nan));
    EXPECT_EQ(a.of(3, 4), b.of(3, 4));
}

TEST(GatherRoulette, DistinguishesLengthsUpToALimit) {
    EXPECT_EQ(worth_after(1, 4, 3), before_any());
    EXPECT_EQ(worth_after(1, 3, 5), before_any());
    GatherRoulette worth;
    GatherSums stats;
    GatherRoulette::observe(30, 40, 1, stats);
    worth.learn(totals(stats));
    EXPECT_EQ(worth.of(30, 40), worth.of(31, 50));
    EXPECT_GT(worth.of(30, 40), before_any());
}

TEST(GatherRoulette, SearchFactorIsThatOfTheLargestRatio) {
    GatherSums stats;
    for (int i = 0; i < 1000; ++i) GatherRoulette::observe(3, 4, 2, stats);
    GatherRoulette worth;
    worth.learn(totals(stats));
    EXPECT_GT(worth.of_search(4), 5 * worth.of_search(3));
}

}  // namespace
}  // namespace etendue
