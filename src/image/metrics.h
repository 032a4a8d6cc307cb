#pragma once
// Distances between an image and its reference. Grey is the mean of the three channels.

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "color/rgb.h"

namespace etendue {

struct ErrorOptions {
    /// A second, independent reference R2 removes the references' own noise from the squared errors:
    /// E[(X − R1)(X − R2)] = E[(X − R)²]. R is (R1 + R2) / 2 wherever a single value is needed.
    std::span<const Rgb> reference2 = {};
    /// Pixels whose reference is brighter, such as lamps seen directly, count only for the two means (m and
    /// mean_ratio).
    float ignore_above = std::numeric_limits<float>::infinity();
};

/// X and R are the grey values of image and reference, means are over pixels, and m = mean R.
struct ImageErrors {
    size_t pixels = 0;      ///< Of the image.
    size_t not_finite = 0;  ///< Pixels with X or R infinite or NaN, left out of everything below.
    size_t ignored = 0;     ///< Pixels above ErrorOptions::ignore_above.
    double mse = 0;         ///< mean (X − R)²; may be negative with two references
    double rmse = 0;        ///< √max(mse, 0)
    double rel_mse = 0;     ///< mean (X − R)² / (R² + 0.01 m²)
    double rel_mse_trimmed = 0;  ///< The same without the largest 0.1 % of the terms.
    double l1 = 0;               ///< mean |X − R|
    double mape = 0;             ///< mean |X − R| / (|R| + 0.01 m)
    double smape = 0;            ///< mean |X − R| / ((|X| + |R|) / 2 + 0.01 m)
    double spike = 0;            ///< 99.99th percentile of |X − R| / m
    double mean_ratio = 0;       ///< mean X / m
};
/// Throws std::invalid_argument where the images differ in size or no pixel is left to compare.
ImageErrors image_errors(std::span<const Rgb> image, std::span<const Rgb> reference,
                         const ErrorOptions& options = {});

/// Per pixel the term of rel_mse; NaN where the image or a reference is not finite.
std::vector<float> relative_squared_errors(std::span<const Rgb> image,
                                           std::span<const Rgb> reference,
                                           std::span<const Rgb> reference2 = {});

}  // namespace etendue
