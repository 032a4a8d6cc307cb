#include "emitter/environment.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "random.h"

namespace etendue {
namespace {

/// A bright upper and a dark lower half: random numbers close to 1 give directions at the border, which may be rounded
/// into a cell of density zero.
TEST(Environment, EverySampleHasADensity) {
    constexpr int kWidth = 8, kSamples = 2000;
    testing::Random random(1);
    for (int height = 4; height <= 64; height += 2) {
        std::vector<Rgb> pixels(size_t(kWidth * height));
        std::fill(pixels.begin(), pixels.begin() + kWidth * height / 2, Rgb(1));
        const auto environment = make_environment(kWidth, height, pixels, Transform());
        int sampled = 0;
        for (int i = 0; i < kSamples; ++i) {
            const FinePoint u{double(random.next_1d()), 1 - double(1 + i % 8) * 0x1p-24};
            DirectSample d;
            if (!environment->sample_direct({}, u, d)) continue;
            ++sampled;
            EXPECT_GT(d.pdf, 0) << height << ' ' << u.x;
        }
        EXPECT_GT(sampled, kSamples / 4) << height;
    }
}

/// Rows of cells at the poles have half the height of the others.
TEST(Environment, AWhiteImageIsSampledUniformly) {
    constexpr int kSamples = 40000;
    const auto environment = make_environment(4, 2, std::vector<Rgb>(8, Rgb(1)), Transform());
    testing::Random random(2);
    int at_poles = 0;
    for (int i = 0; i < kSamples; ++i) {
        DirectSample d;
        // False at a pole, where the density in solid angle has no finite value.
        at_poles += !environment->sample_direct({}, {random.next_1d(), random.next_1d()}, d) ||
                    std::abs(d.wi.y) > std::sqrt(0.5);
    }
    const double expected = 1 - std::sqrt(0.5);  // solid angle of the two rows / 4π
    EXPECT_NEAR(double(at_poles) / kSamples, expected, 4 * std::sqrt(expected / kSamples));
}

/// Sums of pixels could overflow.
TEST(Environment, TheLargestRadianceIsFinite) {
    constexpr float kRadiance = 3e38f;
    for (const bool is_one_pixel : {false, true}) {
        std::vector<Rgb> pixels(32, Rgb(is_one_pixel ? 0 : 1));
        pixels[11] = Rgb(1);
        const auto usual = make_environment(8, 4, pixels, Transform());
        for (Rgb& c : pixels) c *= kRadiance;
        const auto bright = make_environment(8, 4, pixels, Transform());
        EXPECT_NEAR(bright->power() / usual->power() / double(kRadiance), 1, 1e-6);
        testing::Random random(3);
        for (int i = 0; i < 1000; ++i) {
            const FinePoint u{double(random.next_1d()), double(random.next_1d())};
            DirectSample a, b;
            ASSERT_EQ(usual->sample_direct({}, u, a), bright->sample_direct({}, u, b));
            EXPECT_NEAR(length(a.wi - b.wi), 0, 1e-4);
            EXPECT_NEAR(b.pdf / a.pdf, 1, 1e-4);
        }
    }
}

}  // namespace
}  // namespace etendue
