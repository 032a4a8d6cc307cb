// The factor by which the number of pairs changes, where the variance as a function of that number is known.

#include "reuse/gather_radius.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

/// V(m) = 1 - b + b/m, and T(m) = 1 - δ + δ m.
struct Model {
    double b, time;

    double product(double m) const { return (1 - b + b / m) * (1 - time + time * m); }
    /// The number of pairs after a few steps, from the number for which m is 1.
    double chosen() const {
        double m = 1;
        for (int i = 0; i < 3; ++i) {
            std::array<double, kRadiusChanges> moments, times;
            for (size_t k = 0; k < kRadiusChanges; ++k) {
                moments[k] = b / (m * GatherRadius::factor_of_pairs(k));
                times[k] = time * m * GatherRadius::factor_of_pairs(k);
            }
            m *= best_factor_of_pairs(1 - b + b / m, 1 - time + time * m, moments, times);
        }
        return m;
    }
    double best() const { return std::sqrt(b * (1 - time) / ((1 - b) * time)); }
};

TEST(GatherRadius, StepsLeadToNearlyTheLeastProductOfVarianceAndTime) {
    for (const double b : {0.02, 0.3, 0.9})
        for (const double time : {0.05, 0.3, 0.7}) {
            const Model model{b, time};
            SCOPED_TRACE(testing::Message() << "b " << b << ", time " << time << ": "
                                            << model.chosen() << ", best " << model.best());
            EXPECT_LT(model.product(model.chosen()), 1.05 * model.product(model.best()));
        }
}

TEST(GatherRadius, PairsThatGainNothingBecomeFewest) {
    const std::array<double, kRadiusChanges> same{0.1, 0.1, 0.1, 0.1, 0.1},
        rising{0.01, 0.04, 0.16, 0.64, 2.56};
    EXPECT_EQ(best_factor_of_pairs(1, 1, same, rising), 1 / 16.0);
    EXPECT_EQ(best_factor_of_pairs(1, 1, {}, rising), 1 / 16.0);
}

TEST(GatherRadius, PairsThatCostNothingBecomeMost) {
    const std::array<double, kRadiusChanges> same{0.1, 0.1, 0.1, 0.1, 0.1},
        falling{2.56, 0.64, 0.16, 0.04, 0.01};
    EXPECT_EQ(best_factor_of_pairs(1, 1, falling, same), 16);
    EXPECT_EQ(best_factor_of_pairs(1, 1, same, same), 1);
}

/// A pair that roulette leaves with a probability of 1/2, which stands for two: with 4 times as many, each would have 1/8.
TEST(GatherRadius, RouletteLeavesAsManyOfMorePairs) {
    GatherSums sums;
    GatherRadius::observe_trials(3, 0.5, sums);
    const std::array<uint64_t, kRadiusChanges> expected{256 * 3 / 8, 256 * 3 / 2, 256 * 3, 256 * 3,
                                                        256 * 3};
    EXPECT_EQ(sums.trials, expected);
}

/// More pairs take weight from other techniques: from m = 1, odds of 1 grow to 16.
TEST(GatherMoment, KnowsThatWeightsFollowTheCount) {
    const GatherMoment pair = GatherMoment::of(2, 0.5, 1, 0.1, 10, 3);
    const double scale = 3 * 4 * 10;
    EXPECT_DOUBLE_EQ(pair.with(1, 1), scale * (0.25 * 10 + 0.25 / 0.1));
    EXPECT_DOUBLE_EQ(pair.with(4, 1),
                     scale * (std::pow(16.0 / 17, 2) * 10 / 4 + std::pow(1.0 / 17, 2) / 0.1));
    // Where only weights change, the gather's own part does not become smaller.
    EXPECT_DOUBLE_EQ(pair.with(1, 4),
                     scale * (std::pow(16.0 / 17, 2) * 10 + std::pow(1.0 / 17, 2) / 0.1));
    // Roulette does not concern the other techniques.
    EXPECT_DOUBLE_EQ(pair.with(1, 1, 3), scale * (0.25 * 3 * 10 + 0.25 / 0.1));
    const GatherMoment alone = GatherMoment::of(2, 1, 1, 0.1, 10, 3);
    EXPECT_TRUE(alone.is_alone());
    EXPECT_DOUBLE_EQ(alone.with(4, 1), scale * 10 / 4);
}

}  // namespace
}  // namespace etendue
