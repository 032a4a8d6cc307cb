#include "math/statistics.h"

#include <cmath>
#include <limits>
#include <utility>

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

TEST(Statistics, StudentTailsWithClosedForms) {
    for (double t : {0.0, 0.1, 1.0, 2.0, 5.0, 30.0}) {
        // ν = 1, 2, 4: the distribution function is elementary.
        EXPECT_NEAR(student_tail(t, 1), 1 - 2 / M_PI * std::atan(t), 1e-12) << t;
        EXPECT_NEAR(student_tail(t, 2), 1 - t / std::sqrt(2 + t * t), 1e-12) << t;
        const double c = t / std::sqrt(4 + t * t);
        EXPECT_NEAR(student_tail(t, 4), 1 - c * (3 - c * c) / 2, 1e-12) << t;
    }
    // Far tails keep their relative precision: ν = 2, where the tail is 1/t² - 3/2 t⁻⁴ + ….
    EXPECT_NEAR(student_tail(1e6, 2) * 1e12, 1, 1e-9);
    // The normal distribution, and what comes next to it.
    for (double dof : {9e5, 2e6, std::numeric_limits<double>::infinity()})
        EXPECT_NEAR(student_tail(4, dof) / std::erfc(4 / std::sqrt(2.0)), 1, 1e-4) << dof;
}

/// Tabulated quantiles [Abramowitz & Stegun 1964, table 26.10].
TEST(Statistics, StudentQuantiles) {
    for (const auto& [dof, t] : {std::pair{1.0, 12.706},
                                 {2.0, 4.303},
                                 {3.0, 3.182},
                                 {4.0, 2.776},
                                 {9.0, 2.262},
                                 {10.0, 2.228},
                                 {30.0, 2.042},
                                 {1e9, 1.960}})
        EXPECT_NEAR(student_quantile(0.05, dof), t, 6e-4) << dof;
    EXPECT_NEAR(student_quantile(0.01, 10), 3.169, 6e-4);
    // [ibid., 26.7.5] to order 1/ν.
    const double z = kNormalQuantile95, dof = 3e4;
    EXPECT_NEAR(student_quantile(0.05, dof), z + (z * z * z + z) / (4 * dof), 1e-7);
    for (double p : {1e-9, 1e-3, 0.5, 1.0})
        for (double n : {1.0, 2.5, 40.0, 3e4})
            EXPECT_NEAR(student_tail(student_quantile(p, n), n) / p, 1, 1e-6) << p << ' ' << n;
}

TEST(Statistics, WelchDetectsDifferences) {
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
