// The factor by which the number of pairs changes, where the variance as a function of that number is known.

#include "reuse/gather_radius.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

/// V(m) = 1 - b + b/m, and T(m) = 1 - δ + δ m.
struct Model {
    double b, time;

    double product(double m) const { return (1 - b + b / m) * (1 - time + time * m); }
    /// By steps until the number of pairs no longer changes.
    double chosen() const {
        double m = 1;
        for (int i = 0; i < 40; ++i) {
            const double v = 1 - b + b / m, v4 = 1 - b + b / (4 * m), t = 1 - time + time * m;
            m *= GatherRadius::factor_of_pairs(1 - v4 / v, time * m / t);
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
            EXPECT_LT(model.product(model.chosen()), 1.1 * model.product(model.best()));
        }
}

TEST(GatherRadius, PairsThatGainNothingBecomeFew) {
    EXPECT_EQ(GatherRadius::factor_of_pairs(0, 0.3), 0.25);
    EXPECT_EQ(GatherRadius::factor_of_pairs(-1, 0.3), 0.25);
    EXPECT_EQ(GatherRadius::factor_of_pairs(1, 0.3), 4);
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
    const GatherMoment alone = GatherMoment::of(2, 1, 1, 0.1, 10, 3);
    EXPECT_TRUE(alone.is_alone());
    EXPECT_DOUBLE_EQ(alone.with(4, 1), scale * 10 / 4);
}

}  // namespace
}  // namespace etendue
