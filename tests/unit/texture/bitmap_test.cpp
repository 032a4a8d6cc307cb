// Look-ups compared with Mitsuba 3.9.1 (scalar_rgb) on the same pixels, and features of this project.

#include "texture/bitmap.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace etendue {
namespace {

constexpr TextureWrap kWraps[] = {TextureWrap::Repeat, TextureWrap::Mirror, TextureWrap::Clamp};

PixelBuffer float_pixels(int width, int height, int channels, std::vector<float> data) {
    return {.width = width, .height = height, .channels = channels, .data = std::move(data)};
}

PixelBuffer test_image() {
    std::vector<float> data;
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 4; ++x)
            for (int v : {(x * x * 5 + y * 3) % 7, 10 * y + x % 3, x * y % 5})
                data.push_back(float(v));
    return float_pixels(4, 3, 3, data);
}

/// Translation by (0.2, -0.1) after a rotation by 30 degrees after a scaling by (1.5, 0.7).
Transform test_to_uv() {
    return Transform::translate({0.2f, -0.1f, 0}) * Transform::rotate({0, 0, 1}, 30) *
           Transform::scale({1.5f, 0.7f, 1});
}

struct Lookup {
    std::string_view filter, wrap;
    bool to_uv;
    Vec2 uv;
    Rgb expected;
};

// mi.load_dict({"type": "bitmap", "bitmap": ..., "raw": True, ...}).eval(si)
const Lookup kMitsuba[] = {
    {"bilinear", "repeat", false, {0.31f, 0.43f}, {1.9778f, 8.64f, 0.5846f}},
    {"bilinear", "repeat", false, {-0.1f, 0.2f}, {3, 1, 0.27f}},
    {"bilinear", "repeat", false, {1.1f, -1.3f}, {4.68f, 16, 0.18f}},
    {"bilinear", "repeat", false, {2.3f, 1.9f}, {4.38f, 16.7f, 1.12f}},
    {"bilinear", "repeat", false, {-3.01f, 5.01f}, {2.6634f, 9.39999f, 0.2538f}},
    {"bilinear", "repeat", true, {0.31f, 0.43f}, {2.59072f, 8.10402f, 0.889362f}},
    {"bilinear", "repeat", true, {-0.1f, 0.2f}, {3.1538f, 13.2254f, 0.33038f}},
    {"bilinear", "repeat", true, {1.1f, -1.3f}, {3.83581f, 13.785f, 0.113197f}},
    {"bilinear", "repeat", true, {2.3f, 1.9f}, {4.08247f, 19.8956f, 2.91251f}},
    {"bilinear", "mirror", false, {0.31f, 0.43f}, {1.9778f, 8.64f, 0.5846f}},
    {"bilinear", "mirror", false, {-0.1f, 0.2f}, {0.3f, 1, 0}},
    {"bilinear", "mirror", false, {1.1f, -1.3f}, {3.6f, 16, 1.8f}},
    {"bilinear", "mirror", false, {2.3f, 1.9f}, {3.5f, 0.7f, 0}},
    {"bilinear", "mirror", false, {-3.01f, 5.01f}, {2, 20, 1}},
    {"bilinear", "mirror", true, {0.31f, 0.43f}, {2.59072f, 8.10402f, 0.889362f}},
    {"bilinear", "mirror", true, {-0.1f, 0.2f}, {0, 0, 0}},
    {"bilinear", "mirror", true, {1.1f, -1.3f}, {0, 0, 0}},
    {"bilinear", "mirror", true, {2.3f, 1.9f}, {4.08247f, 19.8956f, 2.91251f}},
    {"bilinear", "clamp", false, {0.31f, 0.43f}, {1.9778f, 8.64f, 0.5846f}},
    {"bilinear", "clamp", false, {-0.1f, 0.2f}, {0.3f, 1, 0}},
    {"bilinear", "clamp", false, {1.1f, -1.3f}, {3, 0, 0}},
    {"bilinear", "clamp", false, {2.3f, 1.9f}, {2, 20, 1}},
    {"bilinear", "clamp", false, {-3.01f, 5.01f}, {6, 20, 0}},
    {"bilinear", "clamp", true, {0.31f, 0.43f}, {2.59072f, 8.10402f, 0.889362f}},
    {"bilinear", "clamp", true, {-0.1f, 0.2f}, {0, 0, 0}},
    {"bilinear", "clamp", true, {1.1f, -1.3f}, {3, 0, 0}},
    {"bilinear", "clamp", true, {2.3f, 1.9f}, {2, 20, 1}},
    {"nearest", "repeat", false, {0.31f, 0.43f}, {1, 11, 1}},
    {"nearest", "repeat", false, {-0.1f, 0.2f}, {3, 0, 0}},
    {"nearest", "repeat", false, {1.1f, -1.3f}, {6, 20, 0}},
    {"nearest", "repeat", false, {2.3f, 1.9f}, {4, 21, 2}},
    {"nearest", "repeat", false, {-3.01f, 5.01f}, {3, 0, 0}},
    {"nearest", "repeat", true, {0.31f, 0.43f}, {1, 11, 1}},
    {"nearest", "repeat", true, {-0.1f, 0.2f}, {6, 20, 0}},
    {"nearest", "repeat", true, {1.1f, -1.3f}, {6, 20, 0}},
    {"nearest", "repeat", true, {2.3f, 1.9f}, {5, 22, 4}},
    {"nearest", "mirror", false, {0.31f, 0.43f}, {1, 11, 1}},
    {"nearest", "mirror", false, {-0.1f, 0.2f}, {0, 0, 0}},
    {"nearest", "mirror", false, {1.1f, -1.3f}, {2, 20, 1}},
    {"nearest", "mirror", false, {2.3f, 1.9f}, {5, 1, 0}},
    {"nearest", "mirror", false, {-3.01f, 5.01f}, {2, 20, 1}},
    {"nearest", "clamp", false, {0.31f, 0.43f}, {1, 11, 1}},
    {"nearest", "clamp", false, {-0.1f, 0.2f}, {0, 0, 0}},
    {"nearest", "clamp", false, {1.1f, -1.3f}, {3, 0, 0}},
    {"nearest", "clamp", false, {2.3f, 1.9f}, {2, 20, 1}},
    {"nearest", "clamp", false, {-3.01f, 5.01f}, {6, 20, 0}},
};

TEST(Bitmap, AgreesWithMitsuba3) {
    const PixelBuffer image = test_image();
    for (const Lookup& l : kMitsuba) {
        BitmapTexture::Options options;
        options.filter = l.filter == "nearest" ? TextureFilter::Nearest : TextureFilter::Bilinear;
        options.wrap = l.wrap == "repeat"   ? TextureWrap::Repeat
                       : l.wrap == "mirror" ? TextureWrap::Mirror
                                            : TextureWrap::Clamp;
        if (l.to_uv) options.to_uv = UvTransform(test_to_uv());
        const BitmapTexture texture(image, options);
        const Rgb c = texture.eval(l.uv);
        SCOPED_TRACE(std::string(l.filter) + " " + std::string(l.wrap) + " at " +
                     std::to_string(l.uv.x) + ", " + std::to_string(l.uv.y));
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(c[i], l.expected[i], 1e-4);
        EXPECT_NEAR(texture.eval_scalar(l.uv), luminance(l.expected), 1e-4);
    }
}

TEST(Bitmap, GradientIsTheSlopeOfTheBilinearSurface) {
    const PixelBuffer image = test_image();
    for (TextureWrap wrap : kWraps) {
        BitmapTexture::Options options;
        options.wrap = wrap;
        options.to_uv = UvTransform(test_to_uv());
        const BitmapTexture texture(image, options);
        int checked = 0;
        for (int i = 0; i < 500; ++i) {
            const Vec2 uv = {std::fmod(0.754877666f * float(i), 3.0f) - 1.2f,
                             std::fmod(0.569840291f * float(i), 3.0f) - 1.3f};
            const float h = 1e-3f;
            const auto slope =
                [&](Vec2 d) {  // one-sided ones agree where no edge of a texel is near
                    const float here = texture.eval_scalar(uv);
                    return Vec2{(texture.eval_scalar(uv + d) - here) / h,
                                (here - texture.eval_scalar(uv - d)) / h};
                };
            const Vec2 u = slope({h, 0}), v = slope({0, h}), g = texture.gradient(uv);
            if (std::fabs(u.x - u.y) + std::fabs(v.x - v.y) > 0.2f) continue;
            ++checked;
            ASSERT_NEAR(g.x, (u.x + u.y) / 2, 0.15f) << uv.x << ", " << uv.y;
            ASSERT_NEAR(g.y, (v.x + v.y) / 2, 0.15f) << uv.x << ", " << uv.y;
        }
        EXPECT_GT(checked, 400);
    }
}

TEST(Bitmap, MeanIsTheAverageOfLookups) {
    const PixelBuffer image = test_image();
    for (TextureWrap wrap : kWraps) {
        BitmapTexture::Options options;
        options.wrap = wrap;
        for (const bool moved : {false, true}) {
            if (moved) options.to_uv = UvTransform(test_to_uv());
            const BitmapTexture texture(image, options);
            double sum[3] = {};
            const int n = 480;
            for (int i = 0; i < n * n; ++i) {
                const Rgb c = texture.eval({(float(i % n) + 0.5f) / n, (float(i / n) + 0.5f) / n});
                for (int k = 0; k < 3; ++k) sum[k] += c[k];
            }
            for (int k = 0; k < 3; ++k)
                EXPECT_NEAR(texture.mean()[k], sum[k] / (n * n), moved ? 2e-2 : 1e-3);
        }
    }
}

/// A black image with one white pixel, which no coarse grid of look-ups meets.
PixelBuffer with_one_dot(int size) {
    std::vector<float> data(size_t(size) * size_t(size));
    data[size_t(size) * size_t(size / 2) + size_t(size / 2)] = 1;
    return float_pixels(size, size, 1, std::move(data));
}

TEST(Bitmap, MeanOfWholePeriodsIsExact) {
    constexpr int kSize = 1024;
    const PixelBuffer dot = with_one_dot(kSize);
    const Transform flip = Transform::translate({0, 1, 0}) * Transform::scale({1, -1, 1}),
                    quarter = Transform::rotate({0, 0, 1}, 90),
                    moved = Transform::translate({0.3f, 0.7f, 0}) * Transform::scale({3, 2, 1});
    for (const TextureFilter filter : {TextureFilter::Bilinear, TextureFilter::Nearest}) {
        const auto mean = [&](const Transform& to_uv, TextureWrap wrap) {
            const BitmapTexture texture(
                dot, {.filter = filter, .wrap = wrap, .to_uv = UvTransform(to_uv)});
            return texture.mean().r * kSize * kSize;
        };
        for (const TextureWrap wrap : {TextureWrap::Repeat, TextureWrap::Mirror, TextureWrap::Clamp,
                                       TextureWrap::Zero, TextureWrap::One})
            EXPECT_NEAR(mean(flip, wrap), 1, 1e-5) << int(wrap);
        for (const TextureWrap wrap : {TextureWrap::Repeat, TextureWrap::Mirror}) {
            EXPECT_NEAR(mean(quarter, wrap), 1, 1e-5) << int(wrap);
            EXPECT_NEAR(mean(Transform::scale({3, 2, 1}), wrap), 1, 1e-5) << int(wrap);
        }
        EXPECT_NEAR(mean(moved, TextureWrap::Repeat), 1, 1e-5);
    }
    // Other parts of the plane are not the image: half of a mirrored one, or much of a constant edge.
    const PixelBuffer two = float_pixels(2, 1, 1, {1, 3});
    const auto mean_of_two = [&](const Transform& to_uv, TextureWrap wrap) {
        return BitmapTexture(
                   two,
                   {.filter = TextureFilter::Nearest, .wrap = wrap, .to_uv = UvTransform(to_uv)})
            .mean()
            .r;
    };
    const Transform half = Transform::translate({0.5f, 0, 0}), twice = Transform::scale({2, 2, 1});
    EXPECT_NEAR(mean_of_two(half, TextureWrap::Mirror), 3, 1e-5);
    EXPECT_NEAR(mean_of_two(twice, TextureWrap::Clamp), 2.5f, 1e-5);
    EXPECT_NEAR(mean_of_two(twice, TextureWrap::Zero), 0.5f, 1e-5);
    EXPECT_NEAR(mean_of_two(half, TextureWrap::Repeat), 2, 1e-5);
}

// An emitter whose mean is zero gets no light path and no next event.
TEST(Bitmap, MeanIsZeroOnlyWhereTheImageIs) {
    constexpr int kSize = 1024;
    const Transform to_uv = Transform::rotate({0, 0, 1}, 10) * Transform::scale({0.9f, 0.9f, 1});
    const PixelBuffer dot = with_one_dot(kSize),
                      black = float_pixels(2, 2, 1, std::vector<float>(4));
    EXPECT_GT(BitmapTexture(dot, {.to_uv = UvTransform(to_uv)}).mean().r, 0);
    EXPECT_EQ(BitmapTexture(black, {.to_uv = UvTransform(to_uv)}).mean(), Rgb(0));
    // Every channel for itself.
    std::vector<float> data(size_t(kSize) * kSize * 3);
    for (size_t i = 0; i < data.size(); i += 3) data[i] = 1;
    data[3 * (size_t(kSize) * (kSize / 2) + kSize / 2) + 2] = 1;
    const Rgb mean =
        BitmapTexture(float_pixels(kSize, kSize, 3, data), {.to_uv = UvTransform(to_uv)}).mean();
    EXPECT_NEAR(mean.r, 1, 1e-5);
    EXPECT_EQ(mean.g, 0);
    EXPECT_GT(mean.b, 0);
}

TEST(Bitmap, DecodesByKindOfPixels) {
    // sRGB code 188 is 0.50289 linear; alpha and raw data are not decoded.
    const PixelBuffer codes = {.width = 1,
                               .height = 1,
                               .channels = 4,
                               .data = std::vector<uint8_t>{188, 0, 255, 51},
                               .alpha_channel = 3};
    const Rgb c = BitmapTexture(codes, {}).eval({0.5f, 0.5f});
    EXPECT_NEAR(c.r, 0.502886f, 1e-5);
    EXPECT_EQ(c.g, 0);
    EXPECT_EQ(c.b, 1);
    EXPECT_NEAR(BitmapTexture(codes, {.raw = true}).eval({0.5f, 0.5f}).r, 188 / 255.0f, 1e-6);
    const BitmapTexture alpha(codes, {.channel = 3}), blue(codes, {.channel = 2});
    EXPECT_NEAR(alpha.eval_scalar({0.5f, 0.5f}), 0.2f, 1e-6);
    EXPECT_EQ(blue.eval({0.5f, 0.5f}), Rgb(1));
    EXPECT_EQ(blue.eval_scalar({0.5f, 0.5f}), 1);

    const PixelBuffer half = {.width = 1,
                              .height = 1,
                              .channels = 1,
                              .data = std::vector<Half>{Half(Half::FromBits, 0x3555)}};
    EXPECT_NEAR(BitmapTexture(half, {}).eval_scalar({0, 0}), 0.333251953f, 1e-8);
    const PixelBuffer grey_alpha = float_pixels(1, 1, 2, {0.25f, 0.5f});
    EXPECT_EQ(BitmapTexture(grey_alpha, {}).eval({0, 0}), Rgb(0.25f));
}

TEST(Bitmap, SurvivesCoordinatesThatAreNotFinite) {
    const PixelBuffer image = test_image();
    for (const float u :
         {kInf, -kInf, std::numeric_limits<float>::quiet_NaN(), 1e30f, -1e-30f, -1e30f})
        for (TextureWrap wrap : kWraps)
            for (TextureFilter filter : {TextureFilter::Bilinear, TextureFilter::Nearest}) {
                const BitmapTexture texture(image, {.filter = filter, .wrap = wrap});
                EXPECT_TRUE(is_finite(texture.eval({u, -u})));
                EXPECT_TRUE(is_finite(texture.eval({0.5f, u})));
            }
}

TEST(Bitmap, ResolutionFollowsToUv) {
    const PixelBuffer image = test_image();
    int width, height;
    BitmapTexture(image, {}).resolution(width, height);
    EXPECT_EQ(width, 4);
    EXPECT_EQ(height, 3);
    const Transform quarter_turn_and_scale =
        Transform::rotate({0, 0, 1}, 90) * Transform::scale({20, 10, 1});
    BitmapTexture(image, {.to_uv = UvTransform(quarter_turn_and_scale)}).resolution(width, height);
    EXPECT_EQ(width, 60);
    EXPECT_EQ(height, 40);
}

}  // namespace
}  // namespace etendue
