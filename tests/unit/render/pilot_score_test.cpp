// Scores of pilots, on images whose moments are known.

#include "render/pilot_score.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "math/hash.h"
#include "math/vec.h"

namespace etendue::test {
namespace {

constexpr int kWidth = 32, kHeight = 24;

/// Numbers in [0, 1), by counting.
class Numbers {
public:
    explicit Numbers(uint64_t seed) : seed_(seed) {}
    double operator()() { return double(to_unit_float(uint32_t(hash_combine(seed_, ++n_)))); }

private:
    uint64_t seed_, n_ = 0;
};

/// Images with the values `value(x, y, image, numbers)`.
using Value = std::function<double(int x, int y, int image, Numbers& u)>;
PilotImages images(int count, uint64_t seed, const Value& value, double horizon = 1000) {
    PilotImages p;
    p.horizon = horizon;
    Numbers u(seed);
    for (int i = 0; i < count; ++i) {
        auto& image = p.images.emplace_back();
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x) image.push_back(float(value(x, y, i, u)));
    }
    return p;
}

/// Light of mean 1 and this standard deviation.
Value noisy(double deviation) {
    return [=](int, int, int, Numbers& u) { return 1 + deviation * std::sqrt(12.0) * (u() - 0.5); };
}

/// Light of mean 1, of which this energy comes in values of this size.
Value with_spikes(double energy, double size, double deviation = 0.1) {
    return [=](int, int, int, Numbers& u) {
        const double spike = u() < energy / size ? size : 0;
        return 1 - energy + deviation * std::sqrt(12.0) * (u() - 0.5) + spike;
    };
}

std::vector<PilotScore> score(const std::vector<PilotImages>& methods) {
    return score_pilots(methods, kWidth, kHeight);
}

TEST(PilotScore, IsTheErrorOfTheWholeRendering) {
    const auto scores = score({images(12, 1, noisy(0.2), 100), images(12, 2, noisy(0.4), 100),
                               images(12, 3, noisy(0.4), 1600)});
    EXPECT_NEAR(scores[0].noise, 0.04 / 1.01 / 100, 0.05 * scores[0].noise);
    EXPECT_NEAR(scores[1].noise, 4 * scores[0].noise, 0.1 * scores[1].noise);
    EXPECT_NEAR(scores[2].noise, scores[1].noise / 16, 0.1 * scores[2].noise);
    for (const PilotScore& s : scores) EXPECT_LT(s.missing, 0.02 * s.noise);
}

/// Whether a pilot meets a value beyond V, whose square would decide the score, is chance. Its energy is not.
TEST(PilotScore, CountsTheEnergyOfSpikesAndNotTheirSquares) {
    constexpr double kHorizon = 20, kEnergy = 0.2;  // V = 20
    const auto noise = [&](double size) {
        double sum = 0;
        for (uint64_t seed = 0; seed < 16; ++seed)
            sum += score({images(12, 2 * seed, with_spikes(kEnergy, size), kHorizon),
                          images(12, 2 * seed + 1, noisy(0.1), kHorizon)})[0]
                       .noise /
                   16;
        return sum;
    };
    // Within V, they are noise like all other: energy times size.
    EXPECT_NEAR(noise(10) / noise(5), 2, 0.2);
    // Beyond it, the energy alone counts.
    EXPECT_NEAR(noise(160) / noise(40), 1, 0.3);
    EXPECT_NEAR(noise(160), kEnergy * 20 / 1.01 / kHorizon, 0.3 * noise(160));
}

/// Spikes in one image, which another pilot would not have met, change little.
TEST(PilotScore, OneSpikeDoesNotDecide) {
    const Value calm = noisy(0.3);
    const auto with_one = [&](double size) {
        return images(12, 1, [=](int x, int y, int image, Numbers& u) {
            return calm(x, y, image, u) + (x == 7 && y == 5 && image == 3 ? size : 0);
        });
    };
    const PilotImages other = images(12, 2, noisy(0.4));
    // V is about 1000: the square of the second one counts 64 times as much as that of the first, but 8 times as V |d|.
    const double small = score({with_one(2000), other})[0].noise,
                 large = score({with_one(16000), other})[0].noise,
                 none = score({with_one(0), other})[0].noise;
    EXPECT_NEAR((large - none) / (small - none), 8, 1);
}

/// A method that is calm because it never finds a part of the light.
TEST(PilotScore, CountsMissingLight) {
    const auto lacks = [](double part, int columns) {
        return [=](int x, int, int, Numbers& u) {
            return (x < columns ? 1 - part : 1.0) + 0.1 * (u() - 0.5);
        };
    };
    const PilotImages whole = images(9, 1, noisy(0.5));
    for (const int columns : {2, 8, kWidth}) {
        SCOPED_TRACE(columns);
        const auto scores = score({images(9, 2, lacks(0.5, columns)), whole});
        EXPECT_LT(scores[0].noise, scores[1].noise);
        EXPECT_GT(scores[0].missing, 10 * scores[1].noise);
        EXPECT_GT(scores[0].error(), 3 * scores[1].error());
        EXPECT_LT(scores[1].missing, 0.1 * scores[1].noise);
    }
    // What is within the noise is not certain.
    const auto scores = score({images(9, 2, lacks(0.02, 2)), whole});
    EXPECT_LT(scores[0].missing, 0.1 * scores[1].noise);
}

/// Spikes that one method has met raise its mean. The others lack nothing.
TEST(PilotScore, SpikesAreNoProofOfMissingLight) {
    for (uint64_t seed = 0; seed < 20; ++seed) {
        const auto scores = score({images(6, 2 * seed, with_spikes(0.05, 400, 0.1)),
                                   images(6, 2 * seed + 1, noisy(0.1))});
        EXPECT_LT(scores[1].missing, 0.3 * scores[1].noise + 1e-9) << seed;
    }
}

/// States that follow each other are in one large pixel, but in several small ones.
TEST(PilotScore, OfChainsDependsOnTheSizeOfPixels) {
    const auto noise = [&](int side, double pixels_in_one) {
        PilotImages chains = images(6, 1, [=](int x, int y, int image, Numbers&) {
            const uint64_t block = uint64_t(x / side + 64 * (y / side) + 4096 * image);
            return 1 + 0.5 * (double(to_unit_float(uint32_t(hash_combine(7, block)))) - 0.5);
        });
        chains.pixels_in_one = pixels_in_one;
        chains.least_variance = 0.0003;
        return score({chains, images(6, 2, noisy(0.2))})[0].noise;
    };
    // Independent pixels: their size does not matter.
    EXPECT_NEAR(noise(1, 64) / noise(1, 1), 1, 0.1);
    // Four that are alike: 64 in one have a 64th of the variance.
    EXPECT_NEAR(noise(2, 64) / noise(2, 1), 1.0 / 64, 0.002);
    // But no less than independent states.
    EXPECT_NEAR(noise(2, 1e9), 0.0003 / 1000, 1e-9);
}

/// Chains that stay where they are: each image is smooth, but they disagree.
TEST(PilotScore, DisagreementOfImagesIsNoise) {
    const auto scores =
        score({images(6, 1,
                      [](int x, int, int image, Numbers& u) {
                          const bool is_found = image % 3 == 0;
                          return (x < 8 ? (is_found ? 3.0 : 0.0) : 1.0) + 0.01 * (u() - 0.5);
                      }),
               images(6, 2, noisy(0.5))});
    EXPECT_GT(scores[0].error(), scores[1].error());
}

TEST(PilotScore, OfFilmsOfAnySize) {
    for (const auto& [width, height] : {std::pair{1, 1}, {3, 1}, {5, 40}}) {
        PilotImages p;
        for (int i = 0; i < 4; ++i)
            p.images.emplace_back(size_t(width * height), i % 2 == 0 ? 1.5f : 0.5f);
        p.horizon = 10;
        const std::vector<PilotImages> methods{p, p};
        for (const PilotScore& s : score_pilots(methods, width, height)) {
            const double mean = 1 - std::sqrt(1.0 / 12);  // less its error
            EXPECT_NEAR(s.noise, 1.0 / 3 / (1.01 * mean * mean) / 10, 1e-9);
            EXPECT_EQ(s.missing, 0);
        }
    }
}

TEST(PilotScore, OfBlackImagesIsZero) {
    const Value black = [](int, int, int, Numbers&) { return 0.0; };
    for (const PilotScore& s : score({images(4, 1, black), images(4, 2, black)}))
        EXPECT_EQ(s.error(), 0);
}

/// Any light that one method has met proves that a black one lacks it, even where too few images have it for a test.
TEST(PilotScore, BlackIsNotCalm) {
    const Value black = [](int, int, int, Numbers&) { return 0.0; };
    for (const int every : {3, 4, 6}) {
        SCOPED_TRACE(every);
        const Value rare = [=](int x, int y, int image, Numbers&) {
            return image % every == 2 && x == 9 && y == 4 ? 100.0 : 0.0;
        };
        const auto s = score({images(12, 1, black), images(12, 2, rare)});
        EXPECT_FALSE(s[0].has_light);
        EXPECT_TRUE(s[1].has_light);
        EXPECT_GT(s[1].noise, 0);
        EXPECT_GT(s[0].error(), s[1].error());
    }
}

/// The error of light that one image alone has is its mean. Rounding decides nothing.
TEST(PilotScore, LightInOneImageHasNoNoiseThatIsKnown) {
    const Value black = [](int, int, int, Numbers&) { return 0.0; };
    for (int value = 1; value < 100; ++value) {
        const Value once = [=](int x, int y, int image, Numbers&) {
            return image == value % 12 && x == 9 && y == 4 ? value / 7.0 : 0.0;
        };
        const auto s = score({images(12, 1, black), images(12, 2, once)});
        EXPECT_FALSE(s[0].has_light);
        EXPECT_TRUE(s[1].has_light);
        EXPECT_EQ(s[1].noise, 0) << value;
        EXPECT_EQ(s[0].missing, 0) << value;
    }
}

/// Images of which two and two complement each other, apart from a part that is independent.
TEST(PilotScore, PassesOfASequenceHaveTheNoiseOfTheirMean) {
    PilotImages own = images(12, 5, noisy(0.1), 100), opposite = images(12, 6, noisy(0.4), 100);
    for (size_t k = 0; k < own.images.size(); ++k)
        for (size_t i = 0; i < own.images[k].size(); ++i)
            own.images[k][i] += (k % 2 == 0 ? 1.0f : -1.0f) * (opposite.images[k / 2][i] - 1);
    const double single = 0.01 + 0.16, of_mean = 0.01;
    EXPECT_GT(score({own})[0].noise, 0.9 * single / 101);
    own.in_sequence = 2;
    EXPECT_NEAR(score({own})[0].noise, of_mean / 101, 0.2 * of_mean / 101);
}

/// What falls from film to film beyond the noise of other methods goes on falling; a method that is new has the gain of
/// another one.
TEST(ReuseFactors, GoOnToTheFilmOfTheRendering) {
    using Kind = NoiseOfFilms::Kind;
    const std::vector<NoiseOfFilms> methods{{.kind = Kind::Independent, .before = 1.2, .now = 1},
                                            {.kind = Kind::Reuse, .before = 1.8, .now = 1},
                                            {.kind = Kind::Reuse, .now = 0.7, .like = 1},
                                            {.kind = Kind::Reuse, .now = 0.7},
                                            {.kind = Kind::Reuse, .before = 9, .now = 1},
                                            {.kind = Kind::Chains, .before = 9, .now = 1}};
    const std::vector<double> f = reuse_factors(methods, 4, 16);
    EXPECT_DOUBLE_EQ(f[0], 1);
    EXPECT_NEAR(f[1], 1 / sqr(1.5), 1e-12);
    EXPECT_DOUBLE_EQ(f[2], f[1]);
    EXPECT_DOUBLE_EQ(f[3], 1);
    EXPECT_NEAR(f[4], 1 / sqr(kMostGainOfReuse), 1e-12);
    EXPECT_DOUBLE_EQ(f[5], 1);
    // A narrow film grows less; the largest gain is that of four times as many pixels.
    EXPECT_NEAR(reuse_factors(methods, 2, 16)[4], f[4], 1e-12);
}

// A chain whose first states take 4 s of 10 s has its error after 6 s of samples.
TEST(PilotScore, TimeForAnErrorCountsTheStartOnce) {
    EXPECT_DOUBLE_EQ(seconds_until(0.01, 0.01, 10, 4), 10);
    EXPECT_DOUBLE_EQ(seconds_until(0.01, 0.02, 10, 4), 16);
    EXPECT_DOUBLE_EQ(seconds_until(0.01, 0.02, 10, 0), 20);
    EXPECT_DOUBLE_EQ(seconds_until(0.01, 0.02, 10, 12), 12);
}

}  // namespace
}  // namespace etendue::test
