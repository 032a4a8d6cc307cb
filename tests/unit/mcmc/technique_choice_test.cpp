// Choices of lengths: their probabilities, and the weights of long paths.

#include "mcmc/technique_choice.h"

#include <cmath>

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

/// What a pilot finds of light that decreases by `albedo` with each edge, up to some length.
TechniqueLight light_of(double albedo, int first, int last) {
    TechniqueLight light;
    for (int k = first; k <= last; ++k) light[{k, 1}] = std::pow(albedo, k);
    return light;
}

TEST(LengthChoice, IsMadeWithItsProbability) {
    for (const int longest : {3, 4, 9, 1000000}) {
        for (const TechniqueLight& light :
             {light_of(0, 1, 1), light_of(0.95, 3, 40), light_of(0.3, 3, 9)}) {
            const LengthChoice choice(3, longest, light);
            double sum = 0;
            for (int k = 3; k <= std::min(longest, 2000); ++k) sum += choice.pmf(k);
            EXPECT_NEAR(sum, 1, 1e-9);
            constexpr int kSamples = 100000;
            std::vector<double> found(16);
            for (int i = 0; i < kSamples; ++i) {
                const int k = choice.choose((i + 0.5) / kSamples);
                ASSERT_GE(k, 3);
                ASSERT_LE(k, longest);
                if (k < 16) found[size_t(k)] += 1.0 / kSamples;
            }
            for (int k = 3; k < 16; ++k)
                EXPECT_NEAR(found[size_t(k)], k <= longest ? choice.pmf(k) : 0, 2.0 / kSamples)
                    << k;
        }
    }
}

/// The second moment of light/p(k), relative to the squared mean, stays near 1, although the pilot saw no more than a part
/// of the lengths. With a ratio of 3/4 it has no limit from an albedo of 0.87 on.
TEST(LengthChoice, LongPathsHaveBoundedWeights) {
    for (const double albedo : {0.5, 0.9, 0.95})
        for (const double missed : {0.1, 0.01}) {
            const int seen = int(std::log(missed) / std::log(albedo));
            const LengthChoice choice(12, 1000000, light_of(albedo, 12, 12 + seen));
            double first = 0, second = 0, largest = 0;
            for (int k = 12; k < 900; ++k) {
                const double light = std::pow(albedo, k - 12);
                first += light;
                second += light * light / choice.pmf(k);
                largest = std::max(largest, light / choice.pmf(k));
            }
            EXPECT_LT(second / (first * first), 1.6) << albedo << ", " << seen;
            EXPECT_LT(largest / first, 6) << albedo << ", " << seen;
        }
}

}  // namespace
}  // namespace etendue::test
