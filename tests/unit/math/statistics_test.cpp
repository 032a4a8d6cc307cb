#include "math/statistics.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

TEST(Statistics, MomentsOfFourNumbers) {
    Moments m;
    for (double x : {1.0, 2.0, 4.0, 9.0}) m.add(x);
    EXPECT_DOUBLE_EQ(m.mean(), 4);
    EXPECT_DOUBLE_EQ(m.variance(), 38.0 / 3);
    EXPECT_DOUBLE_EQ(m.squared_error(), 38.0 / 12);
    const Moments same = Moments::estimate(m.mean(), m.squared_error(), m.count());
    EXPECT_DOUBLE_EQ(same.variance(), m.variance());
    EXPECT_EQ(Moments::exact(3).squared_error(), 0);
}

/// Tabulated quantiles [Abramowitz & Stegun 1964, table 26.10].
TEST(Statistics, StudentTails) {
    EXPECT_NEAR(student_tail(12.706, 1), 0.05, 1e-4);
    EXPECT_NEAR(student_tail(2.228, 10), 0.05, 1e-4);
    EXPECT_NEAR(student_tail(3.169, 10), 0.01, 1e-5);
    EXPECT_NEAR(student_tail(1.96, 1e6), 0.05, 1e-4);
    EXPECT_NEAR(student_tail(0, 5), 1, 1e-6);
    EXPECT_NEAR(student_quantile(0.05, 10), 2.2281, 1e-3);
    EXPECT_NEAR(student_quantile(1e-5, 40), 5.0525, 5e-2);
}

TEST(Statistics, WelchFindsWhatDiffers) {
    Moments a, b;
    for (int i = 0; i < 32; ++i) {
        a.add(1 + 0.1 * (i % 5 - 2));
        b.add(1.2 + 0.2 * (i % 7 - 3));
    }
    EXPECT_LT(welch_p(a, b, 0), 0.1);
    EXPECT_GT(welch_p(a, b, 0.2), 0.5);
    EXPECT_EQ(welch_p(Moments::exact(1), Moments::exact(2), 0.5), 0);
    EXPECT_EQ(welch_p(Moments::exact(1), Moments::exact(1.5), 0.5), 1);
    // Between the smaller of the two and their sum.
    EXPECT_GT(welch_dof(a, b), 31);
    EXPECT_LT(welch_dof(a, b), 62);
}

TEST(Statistics, SidakKeepsTheFamily) {
    EXPECT_NEAR(1 - std::pow(1 - sidak(0.01, 100), 100), 0.01, 1e-12);
    EXPECT_NEAR(sidak(0.05, 1), 0.05, 1e-12);
}

}  // namespace
}  // namespace etendue
