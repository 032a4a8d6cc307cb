// The comparison of two methods by the spread over their seeds, on images whose variances are known.

#include "session/seed_series.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

constexpr size_t kPixels = 400;

/// Images with the mean 1 + i/kPixels in pixel i, and a standard deviation proportional to it.
SeedSeries series(uint32_t seed, int seeds, double deviation, double seconds) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    SeedSeries s;
    for (int k = 0; k < seeds; ++k) {
        SeedSeries::Image image;
        for (size_t i = 0; i < kPixels; ++i)
            image.push_back(float((1 + double(i) / kPixels) * (1 + deviation * normal(random))));
        s.add(std::move(image), seconds, {{"accepted", k}});
    }
    return s;
}

TEST(SeedComparison, RatioAndGainAreThoseOfTheDistributions) {
    // Variances of 0.04 and 0.01, times of 3 and 2 seconds.
    const SeedComparison c = compare(series(1, 8, 0.2, 3), series(2, 8, 0.1, 2));
    ASSERT_TRUE(c.is_valid);
    EXPECT_NEAR(c.a.variance, 0.04, 0.003);
    EXPECT_NEAR(c.b.variance, 0.01, 0.001);
    EXPECT_NEAR(c.ratio, 4, 0.5);
    EXPECT_NEAR(c.gain, c.ratio * 1.5, 1e-9);
    EXPECT_DOUBLE_EQ(c.a.seconds, 3);
    EXPECT_LT(c.low, c.gain);
    EXPECT_GT(c.high, c.gain);
    EXPECT_FALSE(c.means_differ);
}

/// Of 200 intervals of 95 %, fewer than 180 contain the true gain with a probability below 1 %.
TEST(SeedComparison, IntervalsCoverTheGain) {
    int covered = 0;
    constexpr int kTrials = 200;
    double width = 0;
    for (uint32_t trial = 0; trial < kTrials; ++trial) {
        const SeedComparison c =
            compare(series(2 * trial, 8, 0.2, 1), series(2 * trial + 1, 8, 0.1, 1));
        covered += c.low <= 4 && 4 <= c.high;
        width += std::log(c.high / c.low) / kTrials;
    }
    EXPECT_GE(covered, 180);
    // The logarithm of a variance from 7·400 degrees of freedom has a standard error of √(2/2800).
    EXPECT_NEAR(width, 2 * 2.145 * std::sqrt(2 * 2.0 / 2800), 0.05);
}

/// Pixels that are mostly black, with few bright samples: 1 and 16 samples a pixel.
TEST(SeedComparison, NoiseDoesNotBiasTheWeights) {
    constexpr uint32_t kTrials = 20;
    const auto rare = [](uint32_t seed, int samples) {
        std::mt19937 random(seed);
        std::bernoulli_distribution hits(0.1);
        SeedSeries s;
        for (int k = 0; k < 8; ++k) {
            SeedSeries::Image image(2000);
            for (float& y : image)
                for (int i = 0; i < samples; ++i) y += hits(random) ? 10 / float(samples) : 0.0f;
            s.add(std::move(image), 1, {});
        }
        return s;
    };
    double mean = 0;
    for (uint32_t t = 0; t < kTrials; ++t)
        mean += compare(rare(2 * t, 1), rare(2 * t + 1, 16)).ratio / kTrials;
    EXPECT_NEAR(mean, 16, 1.5);
}

TEST(SeedComparison, SaysWhatIsUnknown) {
    EXPECT_FALSE(compare({}, {}).is_valid);
    EXPECT_FALSE(compare(series(1, 2, 0.2, 1), series(2, 8, 0.1, 1)).is_valid);
    EXPECT_FALSE(compare(series(1, 8, 0, 1), series(2, 8, 0.1, 1)).is_valid);
    EXPECT_TRUE(compare(series(1, 3, 0.2, 1), series(2, 3, 0.1, 1)).is_valid);
    // A method that finds half of the light.
    SeedSeries dark;
    for (const auto& image : series(1, 8, 0.1, 1).luminance) {
        SeedSeries::Image half = *image;
        for (float& y : half) y *= 0.5f;
        dark.add(std::move(half), 1, {});
    }
    EXPECT_TRUE(compare(dark, series(2, 8, 0.1, 1)).means_differ);
}

TEST(SeedSeries, AveragesFigures) {
    SeedSeries s;
    s.add({1}, 1, {{"accepted", 0.2}, {"once", 4}});
    s.add({1}, 2, {{"accepted", 0.4}});
    ASSERT_EQ(s.figures.size(), 2u);
    EXPECT_DOUBLE_EQ(s.figures[0].second, 0.3);
    EXPECT_DOUBLE_EQ(s.figures[1].second, 2);
    EXPECT_DOUBLE_EQ(s.total_seconds(), 3);
}

}  // namespace
}  // namespace etendue::test
