// Images of other programs: sets with the same and with other expectations, and input that is refused.

#include "verify/image_series.h"

#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

#include "random.h"

namespace etendue::test {
namespace {

constexpr int kSize = 16;

/// Radiance with exponential noise about a mean that differs between pixels.
RgbImage noisy_image(uint64_t seed, float factor = 1,
                     float most = std::numeric_limits<float>::infinity()) {
    testing::Random random(seed);
    RgbImage image{kSize, kSize, {}};
    for (int i = 0; i < kSize * kSize; ++i) {
        const float mean = 1 + float(i) / 64;
        const auto noise = [&] {
            return std::min(-mean * std::log(1 - random.next_1d()), most) * factor;
        };
        image.pixels.push_back({noise(), noise(), noise()});
    }
    return image;
}

ImageSeries series(uint64_t first_seed, int count, const std::function<RgbImage(uint64_t)>& make) {
    ImageSeries s;
    for (int i = 0; i < count; ++i)
        s.add(std::to_string(first_seed) + "." + std::to_string(i),
              make(1000 * first_seed + uint64_t(i)));
    return s;
}

Verdict verdict(const VerifyReport& report) {
    return report.verdict(report.methods.front());
}

/// Of 400 comparisons at α = 5 %, 20 ± 4.4 give a false alarm.
TEST(ImageSeries, HasTheProbabilityOfFalseAlarmsThatItStates) {
    int alarms = 0;
    for (uint64_t i = 0; i < 400; ++i) {
        const auto make = [](uint64_t seed) { return noisy_image(seed); };
        alarms += verdict(verify_images(series(2 * i + 1, 8, make), series(2 * i + 2, 12, make),
                                        0.05)) == Verdict::Deviates;
    }
    EXPECT_GE(alarms, 5);
    EXPECT_LE(alarms, 38);
}

TEST(ImageSeries, FindsAnErrorOfTheSizeThatItStates) {
    const auto right = [](uint64_t seed) { return noisy_image(seed); };
    const VerifyReport equal = verify_images(series(1, 32, right), series(2, 32, right), 0.01);
    EXPECT_EQ(verdict(equal), Verdict::Consistent);
    const std::optional<double> detectable = equal.detectable(equal.methods.front()).image;
    ASSERT_TRUE(detectable);
    EXPECT_LT(*detectable, 0.12);
    // 20 trials, of which two may miss it on average.
    int found = 0;
    for (uint64_t i = 0; i < 20; ++i)
        found += verdict(verify_images(series(3 + 2 * i, 32, right),
                                       series(4 + 2 * i, 32,
                                              [&](uint64_t seed) {
                                                  return noisy_image(seed, 1 + float(*detectable));
                                              }),
                                       0.01)) == Verdict::Deviates;
    EXPECT_GE(found, 14);
}

TEST(ImageSeries, FindsThatAProgramClampsItsSamples) {
    const auto right = [](uint64_t seed) { return noisy_image(seed); };
    const auto clamped = [](uint64_t seed) { return noisy_image(seed, 1, 8); };
    EXPECT_EQ(verdict(verify_images(series(1, 16, clamped), series(2, 16, right), 0.01)),
              Verdict::Deviates);
}

/// An error that cancels in the mean of the image.
TEST(ImageSeries, FindsLightInTheWrongTile) {
    const auto right = [](uint64_t seed) { return noisy_image(seed); };
    const auto moved = [](uint64_t seed) {
        RgbImage image = noisy_image(seed);
        for (size_t y = 0; y < 4; ++y)
            for (size_t x = 0; x < 4; ++x) {
                const Rgb part = image.pixels[kSize * y + x] * 0.4f;
                image.pixels[kSize * y + x] = image.pixels[kSize * y + x] - part;
                image.pixels[kSize * y + x + 8] += part;
            }
        return image;
    };
    const VerifyReport report = verify_images(series(1, 32, moved), series(2, 32, right), 0.01);
    EXPECT_EQ(verdict(report), Verdict::Deviates);
    for (const WelchTest& t : report.methods.front().image) EXPECT_FALSE(report.deviates(t));
}

/// Their spread is that of one contribution in one image.
TEST(ImageSeries, DoesNotTestImagesWithFewContributions) {
    const auto spiky = [](uint64_t seed) {
        RgbImage image = noisy_image(seed, 1e-3f);
        if (seed % 1000 == 5) image.pixels[40] = Rgb(1e5f);
        return image;
    };
    const auto right = [](uint64_t seed) { return noisy_image(seed); };
    EXPECT_EQ(verdict(verify_images(series(1, 16, spiky), series(2, 16, right), 0.01)),
              Verdict::Undecided);
}

/// Blue is not tested where there is none; the other channels are.
TEST(ImageSeries, TestsTheChannelsThatHaveLight) {
    const auto yellow = [](uint64_t seed) {
        RgbImage image = noisy_image(seed);
        for (Rgb& c : image.pixels) c.b = 0;
        return image;
    };
    const VerifyReport report = verify_images(series(1, 64, yellow), series(2, 64, yellow), 0.01);
    EXPECT_EQ(verdict(report), Verdict::Consistent);
    EXPECT_EQ(report.tests, 2 * 17);
}

/// The image with values of 16 bits, as many programs write them.
RgbImage in_halves(RgbImage image) {
    for (Rgb& c : image.pixels) c = {float(Half(c.r)), float(Half(c.g)), float(Half(c.b))};
    return image;
}

/// All of the image but a pixel is a lamp, whose radiance has no noise but the error of rounding.
TEST(ImageSeries, ToleratesTheRoundingOfHalfFloats) {
    // Halfway between two half floats, nearly.
    const auto lamp = [](uint64_t seed, float radiance) {
        RgbImage image = noisy_image(seed);
        for (size_t i = 0; i + 1 < image.pixels.size(); ++i) image.pixels[i] = Rgb(radiance);
        // So that the images are not the same.
        image.pixels.back() = Rgb(radiance) + image.pixels.back() * 1e-3f;
        return image;
    };
    const auto right = [&](uint64_t seed) { return lamp(seed, 1.00048f); };
    const auto rounded = [&](uint64_t seed) { return in_halves(lamp(seed, 1.00048f)); };
    // The two programs differ by less than what separates two half floats.
    const auto other = [&](uint64_t seed) { return in_halves(lamp(seed, 1.0005f)); };
    for (const auto& [a, b] : std::vector<std::array<std::function<RgbImage(uint64_t)>, 2>>{
             {rounded, right}, {right, rounded}, {rounded, other}}) {
        const VerifyReport report = verify_images(series(1, 8, a), series(2, 8, b), 0.01);
        EXPECT_NE(verdict(report), Verdict::Deviates);
        // What is tolerated is no error that would have been found.
        for (const WelchTest& t : report.methods.front().tiles)
            EXPECT_GE(t.detectable(report.level), WelchTest::kHalfRounding);
    }
    const auto wrong = [&](uint64_t seed) { return in_halves(lamp(seed, 1.003f)); };
    EXPECT_EQ(verdict(verify_images(series(1, 8, wrong), series(2, 8, right), 0.01)),
              Verdict::Deviates);
    // Without halves, the tolerance is that of single precision.
    const auto brighter = [&](uint64_t seed) { return lamp(seed, 1.0009f); };
    EXPECT_EQ(verdict(verify_images(series(1, 8, brighter), series(2, 8, right), 0.01)),
              Verdict::Deviates);
}

/// Some images of a caustic that is seldom found have nothing of it.
TEST(ImageSeries, ComparesSetsThatBothHaveBlackImages) {
    const auto rare = [](uint64_t seed) {
        return seed % 1000 < 2 ? noisy_image(0, 0) : noisy_image(seed);
    };
    EXPECT_NE(verdict(verify_images(series(1, 8, rare), series(2, 8, rare), 0.01)),
              Verdict::Deviates);
}

std::string refusal(const std::function<void()>& task) {
    try {
        task();
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return "";
}

TEST(ImageSeries, RefusesImagesThatCannotBeCompared) {
    const auto right = [](uint64_t seed) { return noisy_image(seed); };
    const ImageSeries good = series(1, 4, right);
    EXPECT_NE(refusal([&] {
                  verify_images(series(2, 1, right), good, 0.01);
              }).find("at least two independent images"),
              std::string::npos);
    EXPECT_NE(refusal([&] {
                  verify_images(good, ImageSeries(), 0.01);
              }).find("at least two independent images"),
              std::string::npos);
    EXPECT_NE(refusal([&] {
                  verify_images(good, series(1, 4, right), 0.01);
              }).find("has the same pixels as 1."),
              std::string::npos);
    EXPECT_NE(
        refusal([&] { series(1, 2, [](uint64_t) { return noisy_image(1); }); }).find("same pixels"),
        std::string::npos);
    EXPECT_NE(refusal([&] {
                  ImageSeries s = series(1, 2, right);
                  s.add("small", {2, 1, {Rgb(1), Rgb(2)}});
              }).find("small: has 2 x 1 pixels, but 1.0 has 16 x 16"),
              std::string::npos);
    ImageSeries small;
    small.add("a", {2, 1, {Rgb(1), Rgb(2)}});
    small.add("b", {2, 1, {Rgb(2), Rgb(2)}});
    EXPECT_NE(refusal([&] {
                  verify_images(small, good, 0.01);
              }).find("a: has 2 x 1 pixels, but 1.0 has 16 x 16"),
              std::string::npos);
}

TEST(ImageSeries, RefusesASetThatIsBlack) {
    const auto right = [](uint64_t seed) { return noisy_image(seed); };
    const auto black = [](uint64_t) { return noisy_image(0, 0); };
    EXPECT_NE(refusal([&] {
                  verify_images(series(1, 3, black), series(1, 2, right), 0.01);
              }).find("all images are black"),
              std::string::npos);
}

}  // namespace
}  // namespace etendue::test
