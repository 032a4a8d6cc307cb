#pragma once
// Number of further samples that a test needs, from the spread of those made so far.

#include <span>
#include <vector>

namespace etendue {

/// A difference of means and the required precision.
struct WantedPrecision {
    std::vector<double> squared_errors;  ///< Contribution of each series to the squared error.
    double wanted;                       ///< Required sum of these.
};

/// Factors, at least 1, by which the samples of each series must grow to reach the precision of every mean at the least
/// cost. `seconds` is the cost of each series so far.
///
/// With x_i times the samples the squared error is Σ V_i / x_i, and the cost Σ c_i x_i. The least cost for a given
/// error E² has x_i = √(V_i / c_i) · Σ_j √(V_j c_j) / E² [Neyman 1934]. If x_i < 1, series i has enough samples: x_i =
/// 1, and its error is subtracted from E² for the others. With several means each series takes its largest factor.
std::vector<double> sample_growth(std::span<const WantedPrecision> means,
                                  std::span<const double> seconds);

}  // namespace etendue
