#include "image/tonemap.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "color/srgb.h"

namespace etendue {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Rgb mapped(Rgb c, const ToneMapping& mapping) {
    return tone_map(std::vector<Rgb>{c}, mapping)[0];
}

TEST(ToneMap, NamesOfOperators) {
    EXPECT_EQ(tone_operator("srgb"), ToneOperator::Srgb);
    EXPECT_EQ(tone_operator("reinhard"), ToneOperator::Reinhard);
    EXPECT_EQ(tone_operator("aces"), ToneOperator::Aces);
    EXPECT_FALSE(tone_operator("filmic"));
}

TEST(ToneMap, SrgbClampsAfterExposure) {
    EXPECT_EQ(mapped({-1, 0.25f, 9}, {.exposure = 1}), Rgb(0, 0.5f, 1));
    EXPECT_EQ(mapped(Rgb(0.5f), {.exposure = -2}), Rgb(0.125f));
}

/// No factor is infinite or zero, so that black stays black and infinity white.
TEST(ToneMap, AnyExposureHasAColour) {
    for (const ToneOperator op : {ToneOperator::Srgb, ToneOperator::Reinhard, ToneOperator::Aces})
        for (const float exposure : {-kInfinity, -1000.0f, 128.0f, 1000.0f, kInfinity}) {
            SCOPED_TRACE(exposure);
            EXPECT_EQ(mapped(Rgb(0), {.op = op, .exposure = exposure}), Rgb(0));
            EXPECT_EQ(mapped(Rgb(kInfinity), {.op = op, .exposure = exposure}), Rgb(1));
        }
    EXPECT_EQ(mapped(Rgb(1e-20f), {.exposure = 1000}), Rgb(1));
    EXPECT_LT(mapped(Rgb(1), {.exposure = -1000}).g, 1e-30f);
}

TEST(ToneMap, ReinhardMapsWhiteToOneAndKeepsHues) {
    const ToneMapping mapping = {.op = ToneOperator::Reinhard, .white = 4};
    EXPECT_NEAR(mapped(Rgb(4), mapping).g, 1, 1e-6);
    EXPECT_NEAR(mapped(Rgb(1), mapping).g, (1 + 1 / 16.0) / 2, 1e-6);
    const Rgb c = mapped({0.4f, 0.2f, 0.1f}, mapping);
    EXPECT_NEAR(c.r / c.g, 2, 1e-5);
    EXPECT_NEAR(c.g / c.b, 2, 1e-5);
    // Without a white point the brightest pixel becomes white.
    const auto pair =
        tone_map(std::vector<Rgb>{Rgb(1), Rgb(10)}, {.op = ToneOperator::Reinhard, .exposure = 1});
    EXPECT_NEAR(pair[1].g, 1, 1e-6);
    EXPECT_NEAR(pair[0].g, 2 * (1 + 2 / 400.0) / 3, 1e-6);
    EXPECT_EQ(mapped(Rgb(0), {.op = ToneOperator::Reinhard}), Rgb(0));
}

TEST(ToneMap, AcesCurve) {
    EXPECT_EQ(aces_curve(0), 0);
    // x = 0.6: (2.51 · 0.36 + 0.03 · 0.6) / (2.43 · 0.36 + 0.59 · 0.6 + 0.14)
    EXPECT_NEAR(aces_curve(1), 0.9216 / 1.3688, 1e-6);
    EXPECT_EQ(aces_curve(1e6f), 1);
    for (const double y : {0.1, 0.5, 0.85})
        EXPECT_NEAR(aces_curve(float(inverse_aces_curve(y))), y, 1e-6);
    for (float x = 0; x < 10; x += 0.1f) EXPECT_LE(aces_curve(x), aces_curve(x + 0.1f));
}

TEST(ToneMap, InfinityIsWhiteAndNanStaysNan) {
    for (const ToneOperator op : {ToneOperator::Srgb, ToneOperator::Reinhard, ToneOperator::Aces}) {
        EXPECT_EQ(mapped(Rgb(kInfinity), {.op = op}), Rgb(1));
        EXPECT_TRUE(std::isnan(mapped(Rgb(std::numeric_limits<float>::quiet_NaN()), {.op = op}).r));
    }
}

TEST(Magma, IsNearMatplotlibs) {
    // matplotlib.colormaps["magma"] at 0, 1/4, 1/2, 3/4, 1
    const int codes[5][3] = {
        {0, 0, 4}, {81, 18, 124}, {183, 55, 121}, {252, 137, 97}, {252, 253, 191}};
    float before = -1;
    for (int i = 0; i < 5; ++i) {
        const Rgb c = magma(float(i) / 4);
        for (int k = 0; k < 3; ++k) EXPECT_NEAR(linear_to_srgb(c[k]) * 255, codes[i][k], 4) << i;
        EXPECT_GT(luminance(c), before);
        before = luminance(c);
    }
    EXPECT_EQ(magma(-1), magma(0));
    EXPECT_EQ(magma(7), magma(1));
    EXPECT_TRUE(std::isnan(magma(std::numeric_limits<float>::quiet_NaN()).r));
}

}  // namespace
}  // namespace etendue
