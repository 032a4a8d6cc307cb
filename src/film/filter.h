#pragma once
// Reconstruction filters. A filter is the response of a pixel to light at an offset from the pixel's centre. Every
// sample of the film (an eye path, a splat) contributes to all pixels that the filter reaches from its film point, by
// weights whose sum is 1.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "description/params.h"
#include "math/vec.h"

namespace etendue {

/// Separable filter h(x)·h(y), whose integral over the plane is 1. Units: pixels. Filters that reach more than one pixel
/// (radius above 1/2) are normalised at each film point: h(x) = shape(x) / Σ_i shape(x - i), so that the weights of all
/// pixels are a partition of unity and a constant image has no noise.
class ReconstructionFilter {
public:
    /// Tabulates `shape` (unnormalised, even, zero beyond `radius`); 0 < radius ≤ 16.
    ReconstructionFilter(const char* name, float radius,
                         double (*shape)(double x, double a, double b), double a = 0, double b = 0);
    static ReconstructionFilter box();

    /// h is 0 at this distance and beyond.
    float radius() const { return radius_; }
    const std::string& name() const { return name_; }
    bool is_box() const { return box_; }
    /// Whether a film point can contribute to more than one pixel.
    bool is_wide() const { return radius_ > 0.5f; }

    /// Weights of pixels along one axis; pixel i has its centre at i + 1/2.
    static constexpr int kMostTaps = 32;
    struct Taps {
        int first = 0,
            count = 0;  ///< Of the pixels first … first + count - 1; some weights may be 0.
        std::array<float, kMostTaps> weight;
    };
    /// Weights of the pixels that the film coordinate `x` contributes to; |x| < 2^22. Their number is the same for
    /// every x.
    Taps taps(float x) const;
    int tap_count() const { return box_ ? 1 : 2 * reach_; }

    /// h(x)·h(y).
    float eval(Vec2 offset) const;
    /// An offset with density |h(x) h(y)| / ∫|h h| and the factor h/density (negative in negative lobes).
    struct Sample {
        Vec2 offset;
        float weight;
    };
    Sample sample(Vec2 u) const;

private:
    /// h is piecewise linear between the points of a grid with this many points per pixel.
    static constexpr int kStepsPerPixel = 256;

    /// h(f - k) for k = 1 - reach … reach, at grid point `step` of f in [0, 1].
    const float* row(int step) const { return &table_[size_t(step) * size_t(2 * reach_)]; }
    float eval_1d(float x) const;
    float sample_1d(float u, float& factor) const;

    std::string name_;
    float radius_;
    bool box_ = false;
    int reach_ = 1;             ///< ⌈radius⌉
    std::vector<float> table_;  ///< Rows for f = 0, 1/kStepsPerPixel … 1.
    std::vector<double> cdf_;   ///< CDF of |h| over [-radius, radius], at equal steps.
};

inline ReconstructionFilter::Taps ReconstructionFilter::taps(float x) const {
    Taps t;
    if (box_) {
        t.first = int(std::floor(x)), t.count = 1;
        t.weight[0] = 1;
        return t;
    }
    const float at = x - 0.5f, base = std::floor(at);
    const float steps = (at - base) * kStepsPerPixel;
    const int step = std::min(int(steps), kStepsPerPixel - 1);
    const float part = steps - float(step);
    t.first = int(base) + 1 - reach_, t.count = 2 * reach_;
    const float *a = row(step), *b = row(step + 1);
    for (int k = 0; k < t.count; ++k) t.weight[size_t(k)] = a[k] + part * (b[k] - a[k]);
    return t;
}

struct FilterEntry {
    PluginInfo info;
    ReconstructionFilter (*make)(const Params& params);
};
const std::vector<FilterEntry>& filter_registry();

}  // namespace etendue
