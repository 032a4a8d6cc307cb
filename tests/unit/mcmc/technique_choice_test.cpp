// Choices of lengths: their probabilities, and the weights of long paths.

#include "mcmc/technique_choice.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "test_scenes.h"

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

const std::string kPointLamp =
    "<emitter type=\"point\"><point name=\"position\" value=\"0,0.7,0.5\"/></emitter>";

/// Calls choose(u), and then inverse(v), which is to choose the same. Both are uniformly distributed.
template <class Choose, class Inverse>
void expect_inverse(const Choose& choose, const Inverse& inverse) {
    constexpr int kBins = 20, kNumbers = 40000;
    std::array<int, kBins> counts{};
    for (int i = 0; i < kNumbers; ++i) {
        const double u = (i + 0.5) / kNumbers, v = std::fmod(i * 0.6180339887498949, 1.0);
        const auto chosen = choose(u);
        const double again = inverse(chosen, 0.0005 + 0.999 * v);
        ASSERT_EQ(choose(again), chosen) << u << ", " << again;
        ++counts[size_t(std::min(again * kBins, kBins - 1.0))];
    }
    for (const int n : counts) EXPECT_NEAR(double(n) * kBins / kNumbers, 1, 0.03);
}

TEST(LengthChoice, HasAnInverse) {
    for (const int longest : {3, 4, 9, 1000000})
        for (const TechniqueLight& light :
             {light_of(0, 1, 1), light_of(0.95, 3, 40), light_of(0.3, 3, 9)}) {
            const LengthChoice choice(3, longest, light);
            expect_inverse([&](double u) { return choice.choose(u); },
                           [&](int k, double v) { return choice.number(k, v); });
        }
}

TEST(TechniqueChoice, HasAnInverse) {
    for (const std::string& emitter : {area_lamp(), kPointLamp})
        for (const std::string& camera : {front_camera(8), lens_camera(8)}) {
            const Scene scene = build(camera + room() + emitter);
            const TechniqueChoice choice(scene, 3, 2,
                                         {{{3, 1}, 2.0}, {{3, 3}, 1.0}, {{4, 2}, 1.0}});
            for (const int k : {3, 4, 7})
                expect_inverse([&](double u) { return choice.choose(k, u); },
                               [&](int s, double v) { return choice.number(k, s, v); });
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
