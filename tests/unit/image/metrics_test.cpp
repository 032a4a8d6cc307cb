#include "image/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "image/flip.h"
#include "math/hash.h"

namespace etendue {
namespace {

constexpr float kUndefined = std::numeric_limits<float>::quiet_NaN();

std::vector<Rgb> random_image(size_t n, uint64_t seed) {
    std::vector<Rgb> v(n);
    for (size_t i = 0; i < n; ++i)
        for (int c = 0; c < 3; ++c)
            v[i][c] = to_unit_float(uint32_t(mix64(hash_combine(seed, 3 * i + size_t(c)))));
    return v;
}

TEST(Metrics, ClosedForm) {
    const std::vector<Rgb> x = {Rgb(1), Rgb(2, 3, 4)}, r = {Rgb(2), Rgb(2)};
    const ImageErrors e = image_errors(x, r);
    EXPECT_EQ(e.pixels, 2u);
    EXPECT_EQ(e.not_finite, 0u);
    EXPECT_NEAR(e.mse, 1, 1e-12);
    EXPECT_NEAR(e.rmse, 1, 1e-12);
    EXPECT_NEAR(e.rel_mse, 1 / (4 + 0.01 * 4), 1e-12);
    EXPECT_NEAR(e.l1, 1, 1e-12);
    EXPECT_NEAR(e.mape, 1 / 2.02, 1e-12);
    EXPECT_NEAR(e.smape, (1 / 1.52 + 1 / 2.52) / 2, 1e-12);
    EXPECT_NEAR(e.mean_ratio, 1, 1e-12);
}

TEST(Metrics, IdenticalImagesHaveNoError) {
    std::vector<Rgb> r = random_image(100, 1);
    r[5] = {};
    for (const ImageErrors& e :
         {image_errors(r, r), image_errors(std::vector<Rgb>(4), std::vector<Rgb>(4))}) {
        EXPECT_EQ(e.mse, 0);
        EXPECT_EQ(e.rel_mse, 0);
        EXPECT_EQ(e.rel_mse_trimmed, 0);
        EXPECT_EQ(e.l1, 0);
        EXPECT_EQ(e.mape, 0);
        EXPECT_EQ(e.smape, 0);
    }
    EXPECT_EQ(image_errors(r, r).mean_ratio, 1);
}

TEST(Metrics, SymmetryAndScale) {
    const auto a = random_image(500, 1), b = random_image(500, 2);
    const ImageErrors ab = image_errors(a, b), ba = image_errors(b, a);
    EXPECT_DOUBLE_EQ(ab.mse, ba.mse);
    EXPECT_DOUBLE_EQ(ab.l1, ba.l1);
    EXPECT_NEAR(ab.mean_ratio * ba.mean_ratio, 1, 1e-12);
    EXPECT_NE(ab.rel_mse, ba.rel_mse);
    // Relative errors do not depend on the exposure.
    auto a8 = a, b8 = b;
    for (Rgb& c : a8) c *= 8;
    for (Rgb& c : b8) c *= 8;
    const ImageErrors scaled = image_errors(a8, b8);
    EXPECT_NEAR(scaled.rel_mse, ab.rel_mse, 1e-9);
    EXPECT_NEAR(scaled.rel_mse_trimmed, ab.rel_mse_trimmed, 1e-9);
    EXPECT_NEAR(scaled.mape, ab.mape, 1e-9);
    EXPECT_NEAR(scaled.smape, ab.smape, 1e-9);
    EXPECT_NEAR(scaled.mse, 64 * ab.mse, 1e-9);
}

TEST(Metrics, TrimmingDropsTheWorstThousandth) {
    std::vector<Rgb> x(2000, Rgb(1)), r = x;
    for (int i = 0; i < 3; ++i) x[100 * i] = Rgb(11.0f + float(i));
    const ImageErrors e = image_errors(x, r);
    EXPECT_NEAR(e.rel_mse, (100 + 121 + 144) / 1.01 / 2000, 1e-9);
    EXPECT_NEAR(e.rel_mse_trimmed, 100 / 1.01 / 1998, 1e-9);
}

TEST(Metrics, SecondReferenceRemovesTheReferencesNoise) {
    // X = 1 + 0.1 d, R_i = 1 + noise: the mean of (X − R1)(X − R2) is 0.01 within three standard errors of about
    // σ²/√n + ..., where one reference alone would add the noise's variance 1/12.
    const size_t n = 100000;
    std::vector<Rgb> x(n, Rgb(1.1f)), r1(n), r2(n);
    for (size_t i = 0; i < n; ++i) {
        r1[i] = Rgb(0.5f + to_unit_float(uint32_t(mix64(2 * i + 1))));
        r2[i] = Rgb(0.5f + to_unit_float(uint32_t(mix64(2 * i + 2))));
    }
    EXPECT_NEAR(image_errors(x, r1).mse, 0.01 + 1.0 / 12, 1e-3);
    EXPECT_NEAR(image_errors(x, r1, {.reference2 = r2}).mse, 0.01, 1e-3);
    // The image may be as good as its references, whose product of errors then may be negative.
    const ImageErrors e = image_errors(std::vector<Rgb>{Rgb(1)}, std::vector<Rgb>{Rgb(0.5f)},
                                       {.reference2 = std::vector<Rgb>{Rgb(1.5f)}});
    EXPECT_DOUBLE_EQ(e.mse, -0.25);
    EXPECT_EQ(e.rmse, 0);
}

TEST(Metrics, BrightReferencesCountForMeansOnly) {
    const std::vector<Rgb> x = {Rgb(1), Rgb(30)}, r = {Rgb(1), Rgb(20)};
    const ImageErrors e = image_errors(x, r, {.ignore_above = 3});
    EXPECT_EQ(e.ignored, 1u);
    EXPECT_EQ(e.mse, 0);
    EXPECT_NEAR(e.mean_ratio, 31.0 / 21, 1e-12);
}

TEST(Metrics, PixelsThatAreNotFiniteAreCounted) {
    std::vector<Rgb> x(10, Rgb(2)), r(10, Rgb(1));
    x[3].g = kUndefined;
    x[4].r = std::numeric_limits<float>::infinity();
    r[5].b = kUndefined;
    const ImageErrors e = image_errors(x, r);
    EXPECT_EQ(e.not_finite, 3u);
    EXPECT_EQ(e.mse, 1);
    EXPECT_EQ(e.mean_ratio, 2);
    const auto map = relative_squared_errors(x, r);
    EXPECT_TRUE(std::isnan(map[3]) && std::isnan(map[4]) && std::isnan(map[5]));
    EXPECT_NEAR(map[0], 1 / 1.01, 1e-6);
    EXPECT_THROW(image_errors(std::vector<Rgb>(1, Rgb(kUndefined)), std::vector<Rgb>(1)),
                 std::invalid_argument);
}

TEST(Metrics, SizesMustAgree) {
    const std::vector<Rgb> two(2), three(3);
    EXPECT_THROW(image_errors(two, three), std::invalid_argument);
    EXPECT_THROW(image_errors(two, two, {.reference2 = three}), std::invalid_argument);
    EXPECT_THROW(ldr_flip(two, three, 2, 1), std::invalid_argument);
    EXPECT_THROW(hdr_flip(two, two, 2, 2), std::invalid_argument);
}

// Colours and disturbances of 60 × 40 pixels that flip-evaluator 1.7 (PyPI, by the papers' authors) was given too.
constexpr int kWidth = 60, kHeight = 40;

struct TestPair {
    std::vector<Rgb> ldr, ldr_reference, hdr, hdr_reference;

    TestPair() {
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x) {
                const double u = x, v = y;
                const double r[3] = {0.5 + 0.5 * std::sin(u / 7 + v / 11),
                                     0.5 + 0.4 * std::cos(u / 17),
                                     (x / 13 + y / 9) % 2 * 0.8 + 0.1};
                const double d[3] = {std::sin(u * v), std::cos(u * u + v),
                                     std::sin(3 * u + 5 * v * v)};
                Rgb a, b, c, e;
                for (int k = 0; k < 3; ++k) {
                    a[k] = float(r[k]);
                    b[k] = float(std::clamp(a[k] + 0.2 * d[k], 0.0, 1.0));
                    c[k] = 20 * a[k] * a[k] * a[k] * a[k] + 0.002f;
                    e[k] = float(c[k] * (1 + 0.8 * d[k]));
                }
                ldr_reference.push_back(a);
                ldr.push_back(b);
                hdr_reference.push_back(c);
                hdr.push_back(e);
            }
    }
};

void expect_flip(const FlipResult& flip, double mean, const std::array<float, 5>& pixels) {
    EXPECT_NEAR(flip.mean, mean, 2e-5);
    const int at[5][2] = {{0, 0}, {30, 20}, {59, 39}, {13, 27}, {45, 3}};
    for (int i = 0; i < 5; ++i)
        EXPECT_NEAR(flip.map[at[i][1] * kWidth + at[i][0]], pixels[i], 3e-4) << i;
}

TEST(Flip, AgreesWithTheAuthorsPackage) {
    const TestPair p;
    expect_flip(ldr_flip(p.ldr, p.ldr_reference, kWidth, kHeight), 0.2014645,
                {0.27549f, 0.16353f, 0.30361f, 0.08031f, 0.08876f});
    expect_flip(ldr_flip(p.ldr, p.ldr_reference, kWidth, kHeight, 30), 0.4044485,
                {0.34513f, 0.42891f, 0.44427f, 0.19517f, 0.16541f});
    expect_flip(hdr_flip(p.hdr, p.hdr_reference, kWidth, kHeight), 0.2720372,
                {0.29764f, 0.29473f, 0.06635f, 0.32879f, 0.26027f});
    const auto exposures = flip_exposures(p.hdr_reference);
    ASSERT_EQ(exposures.size(), 3u);
    EXPECT_NEAR(exposures.front(), -2.782971, 1e-3);
    EXPECT_NEAR(exposures.back(), -0.627967, 1e-3);
}

TEST(Flip, IdenticalBlackAndOpposite) {
    const TestPair p;
    EXPECT_EQ(ldr_flip(p.ldr, p.ldr, kWidth, kHeight).mean, 0);
    EXPECT_EQ(hdr_flip(p.hdr, p.hdr, kWidth, kHeight).mean, 0);
    const std::vector<Rgb> black(100), white(100, Rgb(1));
    EXPECT_EQ(hdr_flip(black, black, 10, 10).mean, 0);
    EXPECT_NEAR(ldr_flip(black, white, 10, 10).mean, ldr_flip(white, black, 10, 10).mean, 1e-6);
    EXPECT_GT(ldr_flip(black, white, 10, 10).mean, 0.9);
}

TEST(Flip, LdrIsSymmetric) {
    const TestPair p;
    EXPECT_DOUBLE_EQ(ldr_flip(p.ldr, p.ldr_reference, kWidth, kHeight).mean,
                     ldr_flip(p.ldr_reference, p.ldr, kWidth, kHeight).mean);
}

TEST(Flip, PixelsThatAreNotFiniteAreWrong) {
    TestPair p;
    p.hdr[777].g = kUndefined;
    const FlipResult flip = hdr_flip(p.hdr, p.hdr_reference, kWidth, kHeight);
    EXPECT_EQ(flip.map[777], 1);
    EXPECT_TRUE(std::isfinite(flip.mean));
}

}  // namespace
}  // namespace etendue
