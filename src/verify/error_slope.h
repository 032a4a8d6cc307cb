#pragma once
// Decrease of the error of the mean of n runs with n [Qin et al. 2015, fig. 7].

#include <optional>
#include <vector>

#include "verify/run_series.h"
#include "verify/verify.h"

namespace etendue {

/// Reference image with its own variance, by pixel and channel.
struct ErrorReference {
    std::vector<std::array<Moments, 3>> pixels;

    explicit ErrorReference(const RunSeries& series);
    explicit ErrorReference(const ReferenceImage& image);
};

/// RMSE of the mean of 1, 2, 4 … runs, each averaged over all disjoint groups of that many runs.
std::vector<ErrorOfRuns> errors_of_runs(const RunSeries& series, const ErrorReference& reference);
/// Slope of log RMSE over log n, by least squares; empty for fewer than four points.
std::optional<double> error_slope(const std::vector<ErrorOfRuns>& errors);

}  // namespace etendue
