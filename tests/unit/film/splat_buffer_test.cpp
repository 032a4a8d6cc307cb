#include "film/splat_buffer.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include <gtest/gtest.h>

namespace etendue {
namespace {

/// The buffer's sums, each of them red.
std::vector<float> folded(SplatBuffer& buffer, size_t pixels) {
    std::vector<Rgb> sums(pixels);
    buffer.fold_into(0, sums);
    std::vector<float> red;
    for (const Rgb& s : sums) red.push_back(s.r);
    return red;
}
float sum_of(const std::vector<float>& values, double typical_radiance = 1) {
    SplatBuffer buffer(1, 1, typical_radiance);
    for (const float v : values) buffer.add(0, Rgb(v));
    return folded(buffer, 1)[0];
}

TEST(SplatBuffer, AddsToWhatIsThereAndIsEmptyAfterwards) {
    SplatBuffer buffer(3, 1, 1);
    buffer.add(1, {0.25f, -2, 8});
    buffer.add(1, {0.5f, 1, 0});
    std::vector<Rgb> sums(3, Rgb(1));
    buffer.fold_into(0, sums);
    EXPECT_EQ(sums[1].r, 1.75f);
    EXPECT_EQ(sums[1].g, 0);
    EXPECT_EQ(sums[1].b, 9);
    EXPECT_EQ(sums[0].r, 1);
    EXPECT_EQ(sums[2].b, 1);
    EXPECT_EQ(folded(buffer, 3), std::vector<float>(3));
}

/// Large splats and sums need memory where they are.
TEST(SplatBuffer, NeedsLittleMemoryForAFewLargeSplats) {
    constexpr int kSize = 2048;
    const auto allocated = [] {
        const auto about = mallinfo2();
        return about.uordblks + about.hblkhd;
    };
    SplatBuffer buffer(kSize, kSize, 1);
    std::vector<Rgb> row(kSize);
    const size_t before = allocated();
    buffer.add(700, 900, Rgb(1e20f), {{1}}, {{1}});
    buffer.add(700, 901, Rgb(1e4f), {{1}}, {{1}});
    EXPECT_LT(allocated() - before, 16 * SplatBuffer::kBytesOfLargeSplats);
    buffer.fold_into(900 * kSize, row);
    EXPECT_EQ(row[700].g, 1e20f);
    EXPECT_EQ(row[701].g, 0);
    buffer.clear();
    EXPECT_LE(allocated(), before);
}

TEST(SplatBuffer, RoundsToTheNearestUnit) {
    // The unit is 2^-40. Cut off instead of rounded, a million values lose half a unit each.
    constexpr float kUnit = 0x1p-40f;
    EXPECT_EQ(sum_of({0.6f * kUnit}), kUnit);
    EXPECT_EQ(sum_of({-0.6f * kUnit}), -kUnit);
    EXPECT_EQ(sum_of({0.4f * kUnit}), 0);
    std::mt19937 random(1);
    std::uniform_real_distribution<float> values(0, 16 * kUnit);
    std::vector<float> many(1'000'000);
    double sum = 0;
    for (float& v : many) sum += v = values(random);
    // Four standard errors of a rounding error of variance 1/12.
    EXPECT_NEAR(sum_of(many) / kUnit, sum / kUnit, 4 * std::sqrt(1e6 / 12) + 1);
}

TEST(SplatBuffer, IsAsPreciseForDimAndBrightScenes) {
    std::mt19937 random(2);
    std::vector<float> values(1000);
    for (float& v : values) v = std::exp2(std::uniform_real_distribution<float>(-30, 5)(random));
    const float expected = sum_of(values);
    for (const int exponent : {-60, -9, 1, 60}) {
        std::vector<float> scaled = values;
        for (float& v : scaled) v = std::ldexp(v, exponent);
        EXPECT_EQ(sum_of(scaled, std::ldexp(1.0, exponent)), std::ldexp(expected, exponent));
        // Anything up to twice as much has the same unit.
        EXPECT_EQ(sum_of(scaled, std::ldexp(1.99, exponent)), std::ldexp(expected, exponent));
    }
}

TEST(SplatBuffer, AnyFloatIsSummedWithoutError) {
    constexpr float kMax = std::numeric_limits<float>::max();
    for (const double typical : {1e-45, 1e-9, 1.0, 1e30})
        for (const float v : {1.0f, 1023.0f, 1024.0f, 1025.0f, 1e8f, 1e20f, kMax}) {
            if (double(v) < typical) continue;
            EXPECT_EQ(sum_of({v}, typical), v) << typical;
            EXPECT_EQ(sum_of({-v}, typical), -v) << typical;
            EXPECT_EQ(sum_of({v, 1, -v}, typical), typical < 1e10 ? 1.0f : 0.0f) << v << typical;
        }
    EXPECT_EQ(sum_of({1}, 0), 1) << "a scene without light";
}

/// As much as 2^63 units of digit 0, and more: the sum must not wrap.
TEST(SplatBuffer, DoesNotWrap) {
    std::vector<float> sums;
    for (const float sign : {1.0f, -1.0f}) {
        SplatBuffer buffer(1, 1, 1);
        // 2^22 values of nearly 2^50 units.
        for (int i = 0; i < 1 << 22; ++i) buffer.add(0, {sign * 1023.5f, 0, 0});
        EXPECT_EQ(folded(buffer, 1)[0], sign * 1023.5f * 0x1p22f);
    }
}

/// Splats of several pixels, as of a wide filter.
TEST(SplatBuffer, RowsDoNotWrap) {
    for (const float sign : {1.0f, -1.0f}) {
        SplatBuffer buffer(2, 1, 1);
        for (int i = 0; i < 1 << 22; ++i)
            buffer.add(0, 0, {sign * 1023.5f, 0, 0}, {{1, 0.5f}}, {{1}});
        EXPECT_EQ(folded(buffer, 2),
                  (std::vector<float>{sign * 1023.5f * 0x1p22f, sign * 1023.5f * 0x1p21f}));
    }
}

TEST(SplatBuffer, RadianceOf1e8OnOnePixelDoesNotWrap) {
    SplatBuffer buffer(1, 1, 1);
    for (int i = 0; i < 1 << 20; ++i) buffer.add(0, {1e8f, 100, 1e12f});
    std::vector<Rgb> sum(1);
    buffer.fold_into(0, sum);
    EXPECT_EQ(sum[0].r, 1e8f * 0x1p20f);
    EXPECT_EQ(sum[0].g, 100 * 0x1p20f);
    EXPECT_EQ(sum[0].b, 1e12f * 0x1p20f);
}

/// Values of all sizes and both signs, in many orders and from several threads.
TEST(SplatBuffer, DoesNotDependOnTheOrder) {
    constexpr size_t kPixels = 3;
    std::mt19937 random(3);
    std::vector<std::pair<uint64_t, float>> values;
    for (int i = 0; i < 20000; ++i) {
        const float size = i % 4 == 0
                               ? 1000.0f
                               : std::exp2(std::uniform_real_distribution<float>(-45, 100)(random));
        // The first pixel's sum is far beyond digit 0, the second's mostly cancels.
        const float sign = i % kPixels == 1 && i % 2 == 1 ? -1.0f : 1.0f;
        values.emplace_back(uint64_t(i) % kPixels, sign * size);
    }
    const auto sums = [&](int threads) {
        SplatBuffer buffer(kPixels, 1, 1);
        std::vector<std::thread> workers;
        for (int t = 0; t < threads; ++t)
            workers.emplace_back([&, t] {
                for (int repeat = 0; repeat < 60; ++repeat)
                    for (size_t i = size_t(t); i < values.size(); i += size_t(threads))
                        buffer.add(values[i].first, Rgb(values[i].second));
            });
        for (std::thread& w : workers) w.join();
        return folded(buffer, kPixels);
    };
    const std::vector<float> expected = sums(1);
    for (const int threads : {1, 2, 7}) {
        std::shuffle(values.begin(), values.end(), random);
        EXPECT_EQ(sums(threads), expected) << threads;
    }
}

/// A splat of many pixels, in any tiles, is one of each pixel; also if it comes from several threads.
TEST(SplatBuffer, AddsToRectanglesAsToTheirPixels) {
    constexpr int kWidth = 200, kHeight = 50, kSplats = 3000;
    constexpr uint64_t kPixels = kWidth * kHeight;
    struct Splat {
        int column, row;
        Rgb value;
        std::vector<float> x, y;
    };
    std::mt19937 random(4);
    const auto integer = [&](int low, int high) {
        return std::uniform_int_distribution(low, high)(random);
    };
    std::vector<Splat> splats;
    for (int i = 0; i < kSplats; ++i) {
        Splat s;
        for (std::vector<float>* weights : {&s.x, &s.y})
            for (int k = integer(1, i % 5 == 0 ? int(SplatBuffer::kMostTaps) : 4); k > 0; --k)
                weights->push_back(std::uniform_real_distribution(-0.1f, 1.0f)(random));
        s.column = integer(0, kWidth - int(s.x.size())),
        s.row = integer(0, kHeight - int(s.y.size()));
        s.value = {1, i % 50 == 0 ? 1e20f : 0.1f, i % 70 == 0 ? 3e38f : -1e-9f};
        splats.push_back(std::move(s));
    }
    SplatBuffer expected(kWidth, kHeight, 1);
    for (const Splat& s : splats)
        for (size_t j = 0; j < s.y.size(); ++j)
            for (size_t i = 0; i < s.x.size(); ++i)
                expected.add(uint64_t(s.row + int(j)) * kWidth + uint64_t(s.column) + i,
                             s.value * (s.x[i] * s.y[j]));
    std::vector<Rgb> expected_sums(kPixels);
    expected.fold_into(0, expected_sums);
    for (const size_t threads : {1, 7}) {
        SplatBuffer buffer(kWidth, kHeight, 1);
        std::vector<std::thread> workers;
        for (size_t t = 0; t < threads; ++t)
            workers.emplace_back([&, t] {
                for (size_t i = t; i < splats.size(); i += threads) {
                    const Splat& s = splats[i];
                    buffer.prefetch(s.column, s.row, int(s.x.size()), int(s.y.size()));
                    buffer.add(s.column, s.row, s.value, s.x, s.y);
                }
            });
        for (std::thread& w : workers) w.join();
        std::vector<Rgb> sums(kPixels);
        buffer.fold_into(0, sums);
        EXPECT_EQ(sums, expected_sums) << threads;
    }
}

TEST(SplatBuffer, ForgetsWhatIsCleared) {
    SplatBuffer buffer(2, 1, 1);
    buffer.add(0, Rgb(3));
    buffer.add(1, Rgb(1e9f));
    buffer.add(1, Rgb(1e25f));
    buffer.clear();
    buffer.add(1, Rgb(0.5f));
    EXPECT_EQ(folded(buffer, 2), (std::vector<float>{0, 0.5f}));
}

TEST(SplatBuffer, LeavesOutWhatIsNotFinite) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    EXPECT_EQ(sum_of({1, kInfinity, -kInfinity, std::nanf("")}), 1);
    // The whole value, which is counted once.
    SplatBuffer buffer(1, 1, 1);
    for (const float v : {kInfinity, -kInfinity, std::nanf("")}) {
        buffer.add(0, {1, v, 1e20f});
        buffer.add(0, Rgb(v));
    }
    EXPECT_EQ(buffer.rejected(), 6u);
    buffer.add(0, {2, 1e20f, -0.5f});
    EXPECT_EQ(buffer.rejected(), 6u);
    std::vector<Rgb> sum(1);
    buffer.fold_into(0, sum);
    EXPECT_EQ(sum[0], Rgb(2, 1e20f, -0.5f));
    buffer.clear();
    EXPECT_EQ(buffer.rejected(), 0u);
}

}  // namespace
}  // namespace etendue
