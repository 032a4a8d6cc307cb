#include "math/distribution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <set>
#include <vector>

#include "chi2.h"
#include "random.h"

namespace etendue {
namespace {

using testing::chi2_test;
using testing::Chi2Grid;
using testing::Random;

/// All χ² tests of this file together raise a false alarm with this probability (were the seeds not
/// fixed).
constexpr double kFalseAlarm = 1e-3;
constexpr int kTests = 16;
const double kSignificance = sidak(kFalseAlarm, kTests);
constexpr int kDraws = 200000;

const std::vector<std::vector<double>> kWeights = {
    {1},
    {1, 1, 1, 1, 1},
    {1, 2, 3, 4},
    {0, 0, 5, 0, 1, 0},
    {1e-9, 1, 1e9, 3e8},
    {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 10},
};

FinePoint fine(Vec2 u) {
    return {double(u.x), double(u.y)};
}

TEST(AliasTable, DrawsInProportionToTheWeights) {
    Random random(1);
    for (const auto& weights : kWeights) {
        const AliasTable table(weights);
        const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
        EXPECT_DOUBLE_EQ(table.total(), total);
        std::vector<int64_t> counts(weights.size());
        std::vector<double> probabilities;
        for (size_t i = 0; i < weights.size(); ++i) {
            probabilities.push_back(weights[i] / total);
            EXPECT_FLOAT_EQ(table.pmf(uint32_t(i)), float(weights[i] / total));
        }
        for (int i = 0; i < kDraws; ++i) {
            const auto draw = table.sample(random.next_1d());
            ASSERT_EQ(draw.pmf, table.pmf(draw.index));
            ASSERT_GT(draw.pmf, 0);
            ++counts[draw.index];
        }
        EXPECT_GT(chi2_test(counts, probabilities, kDraws).p_value, kSignificance);
    }
}

// Not a statistical test: over all 2^24 numbers a sampler can give, each index gets its share but
// for the granularity of those numbers.
TEST(AliasTable, SharesAreExactOverAllInputs) {
    constexpr uint32_t kInputs = 1u << 24;
    std::vector<double> weights;
    for (int i = 0; i < 97; ++i) weights.push_back(1 + (i * 37) % 11);
    const AliasTable table(weights);
    std::vector<uint32_t> counts(weights.size());
    for (uint32_t i = 0; i < kInputs; ++i) ++counts[table.sample(float(i) * 0x1p-24f).index];
    for (uint32_t i = 0; i < counts.size(); ++i)
        EXPECT_NEAR(counts[i] / double(kInputs), table.pmf(i), 100.0 / kInputs);
}

/// Of two indices, one very rare: the numbers that choose it are as many as its probability says.
TEST(AliasTable, RareIndicesAreChosenAsOftenAsTheirProbabilitySays) {
    for (const double rare : {1e-7, 2.5e-8, 1e-11}) {
        const std::vector<double> weights{1, rare};
        const AliasTable table(weights);
        // The rare index has one interval of numbers; its ends are found by bisection from a point inside.
        const double inside = 0.5 + 0.25 * table.pmf(1);
        ASSERT_EQ(table.sample(inside).index, 1u);
        double low = 0.25, high = 0.75, begin = inside, end = inside;
        for (int i = 0; i < 80; ++i) {
            const double a = 0.5 * (low + begin), b = 0.5 * (end + high);
            (table.sample(a).index == 1 ? begin : low) = a;
            (table.sample(b).index == 1 ? end : high) = b;
        }
        EXPECT_NEAR((end - begin) / (rare / (1 + rare)), 1, 1e-3) << rare;
    }
}

/// A number that has chosen among a million still places a point finely.
TEST(AliasTable, RescaledNumbersAreFine) {
    const AliasTable table(std::vector<double>(1000000, 1.0));
    Random random(3);
    std::set<float> rests;
    for (int i = 0; i < 1000; ++i) {
        const double u = to_unit_double(random.bits());
        rests.insert(to_float(table.sample(u).u));
    }
    EXPECT_GT(rests.size(), 990u);
}

TEST(AliasTable, TheNumberCanBeUsedAgain) {
    const AliasTable table(kWeights[2]);
    Random random(2);
    // The rescaled number is uniform, and independent of the index.
    constexpr int kCells = 32;
    std::vector<int64_t> counts(4 * kCells);
    std::vector<double> probabilities;
    for (uint32_t i = 0; i < 4; ++i)
        for (int k = 0; k < kCells; ++k) probabilities.push_back(table.pmf(i) / kCells);
    for (int i = 0; i < kDraws; ++i) {
        const auto draw = table.sample(random.next_1d());
        ASSERT_GE(draw.u, 0);
        ASSERT_LT(draw.u, 1);
        ++counts[draw.index * kCells + size_t(draw.u * kCells)];
    }
    EXPECT_GT(chi2_test(counts, probabilities, kDraws).p_value, kSignificance);
}

TEST(AliasTable, ExtremeNumbers) {
    for (const auto& weights : kWeights) {
        const AliasTable table(weights);
        for (const double u : {0.0, 0x1p-53, 0x1p-24, 0.5, 1 - 0x1p-53}) {
            const auto draw = table.sample(u);
            ASSERT_LT(draw.index, weights.size());
            EXPECT_GT(weights[draw.index], 0);
            EXPECT_LT(draw.u, 1);
        }
    }
}

TEST(AliasTable, ZeroWeightsGiveAnEmptyTable) {
    EXPECT_TRUE(AliasTable().empty());
    EXPECT_TRUE(AliasTable(std::vector<double>{}).empty());
    EXPECT_TRUE(AliasTable(std::vector<double>{0, 0}).empty());
    EXPECT_FALSE(AliasTable(std::vector<double>{0, 1}).empty());
}

const std::vector<std::vector<float>> kDensities = {
    {2}, {1, 1, 1, 1}, {1, 0, 3, 0, 0, 2, 7}, {0, 0, 1}, {1, 0, 0}, {1e-3f, 1, 1e3f, 10},
};

TEST(PiecewiseConstant1D, SamplesFollowTheDensity) {
    Random random(3);
    for (const auto& values : kDensities) {
        const PiecewiseConstant1D d(values);
        std::vector<int64_t> counts(values.size());
        std::vector<double> probabilities;
        for (size_t i = 0; i < values.size(); ++i)
            probabilities.push_back(d.pdf((float(i) + 0.5f) / float(values.size())) /
                                    double(values.size()));
        EXPECT_NEAR(std::accumulate(probabilities.begin(), probabilities.end(), 0.0), 1, 1e-6);
        for (int i = 0; i < kDraws; ++i) {
            const auto s = d.sample(random.next_1d());
            ASSERT_GE(s.x, 0);
            ASSERT_LT(s.x, 1);
            ASSERT_GT(s.pdf, 0);
            ++counts[size_t(s.cell)];
        }
        EXPECT_GT(chi2_test(counts, probabilities, kDraws).p_value, kSignificance);
    }
}

TEST(PiecewiseConstant1D, IntegralIsTheMean) {
    EXPECT_DOUBLE_EQ(PiecewiseConstant1D(kDensities[2]).integral(), 13.0 / 7);
    EXPECT_FLOAT_EQ(PiecewiseConstant1D(kDensities[2]).pdf(0.999f), 7 / (13.0f / 7));
}

// The position must lie in the cell whose density comes with it, however the numbers round.
TEST(PiecewiseConstant1D, PositionAndDensityAgree) {
    Random random(4);
    for (const int n : {1, 3, 7, 49, 100, 1000, 1021, 4096, 10000}) {
        std::vector<float> values;
        for (int i = 0; i < n; ++i) values.push_back(1 + float(i % 5));
        const PiecewiseConstant1D d(values);
        int disagreements = 0;
        for (int i = 0; i < kDraws; ++i) {
            const auto s = d.sample(random.next_1d());
            disagreements += d.pdf(s.x) != s.pdf;
        }
        EXPECT_EQ(disagreements, 0) << n << " cells";
    }
}

TEST(PiecewiseConstant1D, ExtremeNumbers) {
    for (const auto& values : kDensities) {
        const PiecewiseConstant1D d(values);
        for (const double u : {0.0, 0x1p-24, 1 - 0x1p-53}) {
            const auto s = d.sample(u);
            EXPECT_GT(values[size_t(s.cell)], 0);
            EXPECT_GE(s.x, 0);
            EXPECT_LT(s.x, 1);
            EXPECT_EQ(d.pdf(s.x), s.pdf);
        }
    }
}

TEST(PiecewiseConstant1D, NoWeightIsUniform) {
    const PiecewiseConstant1D d(std::vector<float>{0, 0, 0, 0});
    EXPECT_EQ(d.integral(), 0);
    EXPECT_FLOAT_EQ(d.sample(0.4f).x, 0.4f);
    EXPECT_EQ(d.pdf(0.4f), 1);
}

// However small a value is beside the others, its cell is sampled; cells of zero never are. Positions are monotone in the
// number, also where many cells share the smallest step of the distribution function.
TEST(PiecewiseConstant1D, SmallValuesKeepTheirCells) {
    constexpr int kCells = 5000;
    std::vector<float> values(kCells, 1e-30f);
    for (int i = 0; i < kCells; i += 7) values[size_t(i)] = 0;
    values[4000] = 1;
    const PiecewiseConstant1D d(values);
    double sum = 0;
    for (int i = 0; i < kCells; ++i) {
        const float pdf = d.pdf((float(i) + 0.5f) / kCells);
        EXPECT_EQ(pdf > 0, values[size_t(i)] > 0) << i;
        sum += double(pdf) / kCells;
    }
    EXPECT_NEAR(sum, 1, 1e-6);
    std::vector<bool> is_sampled(kCells);
    PiecewiseConstant1D::Sample previous{};
    const auto visit = [&](double u) {
        const auto s = d.sample(u);
        EXPECT_GE(s.x, previous.x);
        EXPECT_EQ(d.pdf(s.x), s.pdf);
        is_sampled[size_t(s.cell)] = true;
        previous = s;
    };
    for (int i = 0; i < 2 * kCells; ++i) visit((i + 0.5) * 0x1p-32);  // cells before the large one
    for (int i = 2 * kCells; i > 0; --i) visit(1 - (i - 0.5) * 0x1p-32);  // and behind it
    for (int i = 0; i < kCells; ++i) EXPECT_EQ(is_sampled[size_t(i)], values[size_t(i)] > 0) << i;
}

std::vector<float> image(int width, int height) {
    std::vector<float> values;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) values.push_back(y == 1 ? 0 : float((x * 7 + y * 3) % 5));
    values[size_t(width) + 2] = 0;
    values.back() = 30;
    return values;
}

TEST(PiecewiseConstant2D, SamplesFollowTheDensity) {
    constexpr int kWidth = 12, kHeight = 8;
    const auto values = image(kWidth, kHeight);
    const PiecewiseConstant2D d(values, kWidth, kHeight);
    double mean = 0;
    for (const float v : values) mean += v / double(values.size());
    EXPECT_NEAR(d.integral(), mean, 1e-6 * mean);

    Random random(5);
    Chi2Grid grid(0, 1, kWidth, 0, 1, kHeight);
    for (int i = 0; i < kDraws; ++i) {
        const auto s = d.sample(fine(random.next_2d()));
        ASSERT_EQ(d.pdf(s.uv), s.pdf);
        ASSERT_GT(s.pdf, 0);
        grid.add(s.uv.x, s.uv.y);
    }
    const auto result = grid.test([&](double x, double y) { return d.pdf({float(x), float(y)}); });
    EXPECT_GT(result.p_value, kSignificance);
    EXPECT_NEAR(result.total_probability, 1, 1e-5);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
            EXPECT_NEAR(d.pdf({(float(x) + 0.5f) / kWidth, (float(y) + 0.5f) / kHeight}),
                        values[size_t(y * kWidth + x)] / mean, 1e-4);
}

TEST(PiecewiseConstant2D, PositionAndDensityAgreeInLargeImages) {
    constexpr int kWidth = 1000, kHeight = 499;
    const PiecewiseConstant2D d(image(kWidth, kHeight), kWidth, kHeight);
    Random random(6);
    int disagreements = 0;
    for (int i = 0; i < kDraws; ++i) {
        const auto s = d.sample(fine(random.next_2d()));
        disagreements += d.pdf(s.uv) != s.pdf;
    }
    EXPECT_EQ(disagreements, 0);
}

}  // namespace
}  // namespace etendue
