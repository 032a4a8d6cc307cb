// What pairs are expected to bring, by the lengths of their sub-paths.

#include "integrator/pair_worth.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace etendue {
namespace {

float worth_after(float brought, int s, int t) {
    RenderStats stats;
    for (int i = 0; i < 100000; ++i) PairWorth::observe(3, 4, i % 2 == 0 ? brought : 0.0f, stats);
    PairWorth worth;
    worth.begin_pass(stats);
    return worth.of(s, t);
}

float before_any() {
    PairWorth worth;
    worth.begin_pass({});
    return worth.of(3, 4);
}

TEST(PairWorth, IsTheRootMeanSquareOfWhatJoinsBrought) {
    const float one = worth_after(1, 3, 4);
    EXPECT_NEAR(worth_after(0.1f, 3, 4) / one, 0.1f, 0.001f);
    // Half of them brought nothing; before any join, an eighth is assumed.
    EXPECT_NEAR(one / before_any(), std::sqrt(0.5f) / 0.125f, 0.01f);
}

TEST(PairWorth, TakesWhatIsNoNumberForNothing) {
    RenderStats none, nan;
    PairWorth::observe(3, 4, 0, none);
    PairWorth::observe(3, 4, std::numeric_limits<float>::quiet_NaN(), nan);
    PairWorth a, b;
    a.begin_pass(none);
    b.begin_pass(nan);
    EXPECT_EQ(a.of(3, 4), b.of(3, 4));
}

TEST(PairWorth, TellsLengthsApartUpToALimit) {
    EXPECT_EQ(worth_after(1, 4, 3), before_any());
    EXPECT_EQ(worth_after(1, 3, 5), before_any());
    PairWorth worth;
    RenderStats stats;
    PairWorth::observe(30, 40, 1, stats);
    worth.begin_pass(stats);
    EXPECT_EQ(worth.of(30, 40), worth.of(31, 50));
    EXPECT_GT(worth.of(30, 40), before_any());
}

TEST(PairWorth, SearchesFollowTheLengthThatBringsMost) {
    RenderStats stats;
    for (int i = 0; i < 1000; ++i) PairWorth::observe(3, 4, 2, stats);
    PairWorth worth;
    worth.begin_pass(stats);
    EXPECT_GT(worth.of_search(4), 5 * worth.of_search(3));
}

}  // namespace
}  // namespace etendue
