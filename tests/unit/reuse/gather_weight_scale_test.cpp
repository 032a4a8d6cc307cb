// The scale of the sample counts of gathers, where the number of pairs found is known.

#include "reuse/gather_weight_scale.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

/// The scale chosen after pairs whose probability is the fraction `covered` of that of the disc, where `weight` is the
/// MIS weight of a gather for the initial scale.
float chosen(double covered, double weight) {
    constexpr double kFound = 0.01;
    GatherSums stats;
    const GatherWeightScale first;
    GatherWeightScale::observe(
        GatherMoment::of(1, weight, double(first.value()), kFound, 1 / (covered * kFound), 1),
        stats);
    GatherWeightScale next;
    std::vector<std::unique_ptr<PassSums>> workers;
    workers.push_back(std::make_unique<GatherSums>(stats));
    GatherTotals totals;
    totals.add(workers);
    next.learn(totals);
    return next.value();
}

TEST(GatherWeightScale, StartsWithOneHalf) {
    GatherWeightScale count;
    count.learn({});
    EXPECT_EQ(count.value(), 0.5f);
}

/// The second moment w²/κ + (1-w)²/ρ of a gather that covers the part κ of its disc, and of others with the density ρ,
/// is least for odds κ/ρ of the gather. Here ρ = 1, so that its odds are c².
TEST(GatherWeightScale, FollowsTheLeastSecondMoment) {
    const double odds_at_half = 0.25;
    EXPECT_EQ(chosen(1, odds_at_half / (1 + odds_at_half)), 1);
    // √0.1 lies between 1/2 and 1/4, whose moments hardly differ; √0.02 between 1/4 and 1/8.
    EXPECT_EQ(chosen(0.1, odds_at_half / (1 + odds_at_half)), 0.5f);
    EXPECT_EQ(chosen(0.02, odds_at_half / (1 + odds_at_half)), 0.25f);
}

TEST(GatherWeightScale, IgnoresPathsWithoutOtherTechniques) {
    GatherSums stats;
    GatherWeightScale::observe(GatherMoment::of(1, 1, 1, 0.01, 100, 1), stats);
    for (const uint64_t m : stats.weight_moments) EXPECT_EQ(m, 0u);
}

}  // namespace
}  // namespace etendue
