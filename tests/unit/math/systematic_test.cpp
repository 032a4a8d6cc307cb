#include "math/systematic.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

namespace etendue {
namespace {

constexpr std::array<double, 8> kProbabilities{0.3, 1, 0.001, 0.75, 0, 1, 0.2, 0.449};

TEST(SystematicSampling, SelectsEachItemWithItsProbability) {
    constexpr int kStarts = 100000;
    std::array<int, kProbabilities.size()> selected{};
    for (int k = 0; k < kStarts; ++k) {
        SystematicSampling sampling((k + 0.5) / kStarts);
        for (size_t i = 0; i < selected.size(); ++i)
            selected[i] += sampling.selects(kProbabilities[i]);
    }
    for (size_t i = 0; i < selected.size(); ++i)
        EXPECT_NEAR(double(selected[i]) / kStarts, kProbabilities[i], 2.0 / kStarts) << i;
}

TEST(SystematicSampling, SelectsTheExpectedNumberRoundedUpOrDown) {
    double expected = 0;
    for (const double p : kProbabilities) expected += p;
    for (const double u : {0.0, 0.1, 0.29, 0.31, 0.5, 0.8, 0.999999}) {
        SystematicSampling sampling(u);
        int count = 0;
        for (const double p : kProbabilities) count += sampling.selects(p);
        EXPECT_GE(count, int(std::floor(expected)));
        EXPECT_LE(count, int(std::ceil(expected)));
    }
}

}  // namespace
}  // namespace etendue
