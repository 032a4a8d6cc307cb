#pragma once
// How many more samples a test needs, from the spread of what there is.

#include <span>
#include <vector>

namespace etendue {

/// A mean that is compared, and how exact it is to be.
struct WantedPrecision {
    std::vector<double> squared_errors;  ///< That each series adds to the comparison.
    double wanted;                       ///< Sum of these that is asked for.
};

/// Factors, at least 1, by which each series' samples must grow for all that is wanted, at the least cost. `seconds` is
/// what each series has cost so far.
///
/// With x_i times the samples the squared error is Σ V_i / x_i, and the cost Σ c_i x_i. The least cost for a given error E²
/// has x_i = √(V_i / c_i) · Σ_j √(V_j c_j) / E² [Neyman 1934]. Where that is less than 1, series i has enough, and the
/// others share what its error leaves. Of several means each series takes the largest factor.
std::vector<double> sample_growth(std::span<const WantedPrecision> means,
                                  std::span<const double> seconds);

}  // namespace etendue
