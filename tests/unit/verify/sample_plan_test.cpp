// Planning of samples: the least cost, and no influence on the rate of false alarms.

#include "verify/sample_plan.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "verify/welch_test.h"

namespace etendue::test {
namespace {

double error_after(const WantedPrecision& mean, const std::vector<double>& growth) {
    double sum = 0;
    for (size_t i = 0; i < growth.size(); ++i) sum += mean.squared_errors[i] / growth[i];
    return sum;
}

TEST(SamplePlan, ReachesTheErrorAtTheLeastCost) {
    const WantedPrecision mean{{9, 1}, 2};
    const std::vector<double> seconds{4, 1};
    const auto growth = sample_growth(std::vector{mean}, seconds);
    EXPECT_NEAR(error_after(mean, growth), mean.wanted, 1e-9);
    const double cost = growth[0] * seconds[0] + growth[1] * seconds[1];
    for (const double x : {0.9, 0.97, 1.03, 1.2}) {
        const double first = growth[0] * x, second = 1 / (mean.wanted - 9 / first);
        EXPECT_GT(first * seconds[0] + second * seconds[1], cost);
    }
}

TEST(SamplePlan, KeepsSeriesThatArePreciseEnough) {
    const WantedPrecision mean{{100, 1e-3, 0}, 10};
    const auto growth = sample_growth(std::vector{mean}, std::vector{1.0, 5.0, 1.0});
    EXPECT_NEAR(growth[0], 100 / (10 - 1e-3), 1e-9);
    EXPECT_EQ(growth[1], 1);
    EXPECT_EQ(growth[2], 1);
    const auto none = sample_growth(std::vector{WantedPrecision{{1, 2}, 4}}, std::vector{1.0, 1.0});
    EXPECT_EQ(none, (std::vector<double>{1, 1}));
}

TEST(SamplePlan, TakesTheLargestOfSeveral) {
    const std::vector<WantedPrecision> means{{{4, 0}, 1}, {{0, 9}, 1}};
    EXPECT_EQ(sample_growth(means, std::vector{1.0, 1.0}), (std::vector<double>{4, 9}));
}

/// Equal means, with samples added until an error at the limit of detection would be found: the rate of false alarms
/// remains at the level of the test.
TEST(SamplePlan, StoppingBySpreadDoesNotRaiseFalseAlarms) {
    constexpr int kTrials = 20000, kRuns = 32;
    constexpr double kLevel = 0.01;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    int alarms = 0, looks = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        // Sums over `samples` normal values of unit variance, around a mean of 100.
        double sums[2][kRuns] = {}, samples = 0;
        for (double more = 1; more <= 16; more *= 2, ++looks) {
            Moments sides[2];
            samples += more;
            for (int side = 0; side < 2; ++side)
                for (double& sum : sums[side]) {
                    sum += std::sqrt(more) * normal(random);
                    sides[side].add(100 + sum / samples);
                }
            const WelchTest test{sides[0], sides[1], 1e9, welch_p(sides[0], sides[1], 0)};
            // An error that would be found according to about half of all estimates with three times the samples.
            if (test.detectable(kLevel) > 0.0056 && more < 16) continue;
            alarms += test.p < kLevel;
            break;
        }
    }
    EXPECT_GT(looks, kTrials / 2);
    const double rate = double(alarms) / kTrials, spread = std::sqrt(kLevel / kTrials);
    EXPECT_LT(rate, 1.1 * kLevel + 3 * spread);
    EXPECT_GT(rate, 0.8 * kLevel - 3 * spread);
}

}  // namespace
}  // namespace etendue::test
