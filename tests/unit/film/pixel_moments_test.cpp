// Moments of pixels against sums in two steps.

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "film/pixel_moments.h"
#include "math/hash.h"

namespace etendue::test {
namespace {

/// Values of a pixel with a mean much above their spread, apart from a few spikes.
std::vector<Rgb> values_of(uint64_t seed, int count, float spread) {
    std::vector<Rgb> values;
    for (int i = 0; i < count; ++i) {
        const auto u = [&](uint64_t c) {
            return to_unit_float(uint32_t(mix64(hash_combine(seed, 3 * uint64_t(i) + c))));
        };
        const float spike = i % 1000 == 7 ? 30.0f : 0.0f;
        values.push_back({1 + spread * u(0) + spike, 20 + spread * u(1), spread * u(2)});
    }
    return values;
}

PixelMoments moments_of(const std::vector<Rgb>& values) {
    PixelMoments m;
    for (size_t i = 0; i < values.size(); ++i) m.add(values[i], double(i));
    return m;
}

/// Σ (v - mean)² of what `part` takes of each value.
template <class Part>
double squared_deviations(const std::vector<Rgb>& values, const Part& part) {
    double mean = 0, sum = 0;
    for (const Rgb v : values) mean += double(part(v)) / double(values.size());
    for (const Rgb v : values) sum += sqr(double(part(v)) - mean);
    return sum;
}

void expect_moments(const PixelMoments& m, const std::vector<Rgb>& values) {
    const auto n = double(values.size());
    const double precision =
        3e-7 * std::sqrt(n);  // a sum of n rounding errors that are independent
    for (int c = 0; c < 3; ++c) {
        const double expected = squared_deviations(values, [c](Rgb v) { return v[c]; });
        EXPECT_NEAR(sqr(double(m.deviation[c])), expected, precision * expected) << c;
        EXPECT_NEAR(double(m.variance_of_mean(n)[c]), expected / (n * (n - 1)),
                    precision * expected / (n * (n - 1)))
            << c;
    }
    const double expected = squared_deviations(values, exact_luminance<Rgb>);
    EXPECT_NEAR(sqr(double(m.luminance_deviation)), expected, precision * expected);
}

TEST(PixelMoments, AreThoseOfTheValues) {
    for (const int count : {2, 3, 10, 1000, 100000})
        for (const float spread : {1e-3f, 1.0f}) {
            SCOPED_TRACE(testing::Message() << count << " values, spread " << spread);
            const std::vector<Rgb> values = values_of(1, count, spread);
            expect_moments(moments_of(values), values);
        }
}

TEST(PixelMoments, OfEqualValuesHaveNoVariance) {
    const PixelMoments m = moments_of(std::vector<Rgb>(12345, Rgb(0.1f, 1 / 3.0f, 7e5f)));
    EXPECT_EQ(m.variance_of_mean(12345), Rgb(0));
    EXPECT_EQ(m.luminance_deviation, 0);
    EXPECT_EQ(m.mean(12345), Rgb(0.1f, 1 / 3.0f, 7e5f));
    EXPECT_EQ(PixelMoments().mean(0), Rgb(0));
    EXPECT_EQ(moments_of({Rgb(2)}).variance_of_mean(1), Rgb(0));
}

TEST(PixelMoments, OfTwoSetsAddUp) {
    std::vector<Rgb> values = values_of(2, 700, 0.1f);
    PixelMoments sum = moments_of(values);
    for (Rgb& v : values = values_of(3, 1900, 0.3f)) v *= 1.01f;
    const std::vector<Rgb> more = values;
    const PixelMoments other = moments_of(more);
    values = values_of(2, 700, 0.1f);
    values.insert(values.end(), more.begin(), more.end());
    sum.merge(other, 700, 1900);
    expect_moments(sum, values);

    PixelMoments same = other;
    same.merge(PixelMoments(), 1900, 0);
    PixelMoments none;
    none.merge(other, 0, 1900);
    for (const PixelMoments& m : {same, none})
        for (int c = 0; c < 3; ++c) {
            EXPECT_EQ(m.sum[c], other.sum[c]);
            EXPECT_EQ(m.deviation[c], other.deviation[c]);
        }
}

}  // namespace
}  // namespace etendue::test
