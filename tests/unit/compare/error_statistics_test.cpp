#include "compare/error_statistics.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "random.h"

namespace etendue {
namespace {

using testing::Random;

/// Box and Muller's.
double normal(Random& random) {
    const double u = 1 - random.next_1d(), v = random.next_1d();
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * M_PI * v);
}

TEST(MeanInterval, HoldsTheMeanInNineteenOfTwentyCases) {
    Random random(1);
    constexpr int kTrials = 20000;
    for (const int n : {2, 4, 16}) {
        int inside = 0;
        for (int i = 0; i < kTrials; ++i) {
            std::vector<double> samples;
            for (int k = 0; k < n; ++k) samples.push_back(5 + 2 * normal(random));
            const Interval interval = *mean_interval(samples);
            inside += interval.low <= 5 && 5 <= interval.high;
        }
        // Four standard deviations: false alarms below 1e-4.
        EXPECT_NEAR(double(inside) / kTrials, 0.95, 4 * std::sqrt(0.95 * 0.05 / kTrials))
            << n << " samples";
    }
}

TEST(MeanInterval, NeedsTwoSamples) {
    EXPECT_FALSE(mean_interval({}));
    EXPECT_FALSE(mean_interval(std::vector<double>{1}));
    const Interval same = *mean_interval(std::vector<double>{3, 3});
    EXPECT_EQ(same.low, 3);
    EXPECT_EQ(same.high, 3);
}

TEST(PowerLaw, FindsTheExponent) {
    std::vector<double> times, errors;
    for (int i = 0; i < 12; ++i) {
        times.push_back(0.1 * std::pow(1.5, i));
        errors.push_back(7 * std::pow(times.back(), -0.5));
    }
    const PowerLaw law = *fit_power_law(times, errors);
    EXPECT_NEAR(law.slope, -0.5, 1e-12);
    EXPECT_NEAR(law.factor, 7, 1e-9);
    EXPECT_EQ(law.points, 12);
}

TEST(PowerLaw, IgnoresNonPositiveErrorsAndEarlyTimes) {
    // Errors below the reference's noise may be negative; early times are another regime.
    const std::vector<double> times = {0.01, 1, 2, 4, 8, 16}, errors = {1e9, 1, 0.5, -1, 0.125, 0};
    const PowerLaw law = *fit_power_law(times, errors, 0.5);
    EXPECT_EQ(law.points, 3);
    EXPECT_NEAR(law.slope, -1, 1e-12);
    EXPECT_FALSE(fit_power_law(times, errors, 1.5));
    EXPECT_FALSE(fit_power_law(std::vector<double>{2, 2, 2}, std::vector<double>{1, 2, 3}));
    EXPECT_FALSE(fit_power_law({}, {}));
}

TEST(Efficiency, IsTheRatioOfErrorTimesTime) {
    const std::vector<double> base = {0.4 * 10}, method = {0.1 * 20};
    const Efficiency e = *relative_efficiency(base, method);
    EXPECT_NEAR(e.value, 2, 1e-12);
    EXPECT_FALSE(e.interval);
    EXPECT_FALSE(relative_efficiency(base, std::vector<double>{-0.1 * 20}));
}

TEST(Efficiency, IntervalHoldsTheTruth) {
    Random random(2);
    constexpr int kTrials = 4000, kRuns = 8;
    int inside = 0;
    for (int i = 0; i < kTrials; ++i) {
        std::vector<double> base, method;
        for (int k = 0; k < kRuns; ++k) {
            base.push_back(4 * (1 + 0.1 * normal(random)));
            method.push_back(1 + 0.1 * normal(random));
        }
        const Interval e = *relative_efficiency(base, method)->interval;
        inside += e.low <= 4 && 4 <= e.high;
    }
    // Student's t with the runs of one side is a little wide for two.
    EXPECT_GE(double(inside) / kTrials, 0.94);
    EXPECT_LE(double(inside) / kTrials, 0.985);
}

TEST(RatioInterval, AddsRelativeVariances) {
    const Interval i = ratio_interval(2, {0.03 * 0.03}, {0.04 * 0.04});
    EXPECT_NEAR(i.high - i.value, kNormalQuantile95 * 2 * 0.05, 1e-7);
    EXPECT_NEAR(i.value - i.low, kNormalQuantile95 * 2 * 0.05, 1e-7);
}

TEST(RatioInterval, IsUnknownWhereAnErrorIs) {
    for (const Interval& i :
         {ratio_interval(2, kUnknownError, {}), ratio_interval(2, {0.01, 3}, kUnknownError)}) {
        EXPECT_EQ(i.low, -std::numeric_limits<double>::infinity());
        EXPECT_EQ(i.high, std::numeric_limits<double>::infinity());
    }
}

/// Whatever the number of samples.
TEST(RatioInterval, HasItsLevel) {
    constexpr int kTrials = 4000;
    Random random(5);
    for (const int samples : {2, 3, 8}) {
        int inside = 0;
        for (int trial = 0; trial < kTrials; ++trial) {
            Moments x, r;
            for (int k = 0; k < samples; ++k) x.add(1 + 0.02 * normal(random));
            for (int k = 0; k < 200; ++k) r.add(1 + 0.02 * normal(random));
            const auto error = [](const Moments& m) {
                return SquaredError{m.squared_error() / (m.mean() * m.mean()),
                                    double(m.count() - 1)};
            };
            const Interval i = ratio_interval(x.mean() / r.mean(), error(x), error(r));
            inside += i.low <= 1 && 1 <= i.high;
        }
        EXPECT_GE(double(inside) / kTrials, 0.935) << samples;
        EXPECT_LE(double(inside) / kTrials, 0.965) << samples;
    }
}

}  // namespace
}  // namespace etendue
