#pragma once
// Mean and variance of a pixel over the passes.

#include <bit>
#include <cmath>
#include <cstdint>

#include "color/rgb.h"
#include "math/hash.h"
#include "math/vec.h"

namespace etendue {

/// luminance(), but without the rounding to float, which would be a variance between equal passes.
template <class T>
double exact_luminance(const T& channels) {
    constexpr double kRed = luminance(Rgb(1, 0, 0)), kGreen = luminance(Rgb(0, 1, 0)),
                     kBlue = luminance(Rgb(0, 0, 1));
    return kRed * double(channels[0]) + kGreen * double(channels[1]) + kBlue * double(channels[2]);
}

/// A float next to x ≥ 0. A hash of the digits of x decides between the two, with probabilities by which x is the mean. Sums
/// of many small terms are right on average, then, where rounding to the nearest float would leave all of them out.
inline float rounded_at_random(double x) {
    constexpr uint64_t kRest = (uint64_t(1) << 29) - 1;  // digits of a double that a float has not
    const auto bits = std::bit_cast<uint64_t>(x);
    return float(std::bit_cast<double>((bits + (mix64(bits << 12) & kRest)) & ~kRest));
}

/// Sums over the values v of a pixel in n passes. A deviation is √Σ (v − mean)², from the mean of the n values. Unlike Σ v², it
/// needs no more than a float, since no almost equal numbers are subtracted [Welford 1962], and its range is that of v.
struct PixelMoments {
    double sum[3] = {0, 0, 0};
    float deviation[3] = {0, 0, 0};  ///< By channel.
    float luminance_deviation = 0;

    /// Adds a value to those of `n` passes.
    void add(Rgb v, double n) {
        // Σ (v − mean)² grows by n/(n + 1) times the squared distance of the new value from the mean of the others.
        if (n > 0) {
            const double distance[3] = {double(v.r) - sum[0] / n, double(v.g) - sum[1] / n,
                                        double(v.b) - sum[2] / n};
            spread(distance, n / (n + 1));
        }
        for (int c = 0; c < 3; ++c) sum[c] += double(v[c]);
    }
    /// Adds those of `m` other passes to these of `n` passes [Chan et al. 1979].
    void merge(const PixelMoments& other, double n, double m) {
        if (m == 0) return;
        if (n == 0) {
            *this = other;
            return;
        }
        const auto join = [](float& a, float b) {
            a = rounded_at_random(std::hypot(double(a), double(b)));
        };
        double distance[3];
        for (int c = 0; c < 3; ++c) {
            join(deviation[c], other.deviation[c]);
            distance[c] = other.sum[c] / m - sum[c] / n;
        }
        join(luminance_deviation, other.luminance_deviation);
        spread(distance, n * m / (n + m));
        for (int c = 0; c < 3; ++c) sum[c] += other.sum[c];
    }

    /// The mean of `n` values; 0 if there are none.
    Rgb mean(double n) const {
        const double inv = n > 0 ? 1 / n : 0;
        return {float(sum[0] * inv), float(sum[1] * inv), float(sum[2] * inv)};
    }
    /// Variance of that mean, by channel; 0 for fewer than two values.
    Rgb variance_of_mean(double n) const {
        if (n < 2) return Rgb(0);
        const double inv = 1 / (n * (n - 1));
        return {float(sqr(double(deviation[0])) * inv), float(sqr(double(deviation[1])) * inv),
                float(sqr(double(deviation[2])) * inv)};
    }
    float luminance_sum() const {
        return luminance(Rgb(float(sum[0]), float(sum[1]), float(sum[2])));
    }

private:
    /// Adds `factor` times the squares of distances.
    void spread(const double (&distance)[3], double factor) {
        const auto grow = [factor](float& deviation, double d) {
            deviation = rounded_at_random(std::sqrt(sqr(double(deviation)) + factor * d * d));
        };
        for (int c = 0; c < 3; ++c) grow(deviation[c], distance[c]);
        grow(luminance_deviation, exact_luminance(distance));
    }
};
static_assert(sizeof(PixelMoments) == 40, "films of large images consist of these");

}  // namespace etendue
