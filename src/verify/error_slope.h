#pragma once
// How the error of the mean of n runs falls with n [Qin et al. 2015, fig. 7].

#include <optional>
#include <vector>

#include "verify/run_series.h"
#include "verify/verify.h"

namespace etendue {

/// The image that errors are measured from, and its own variance; by channel.
struct ErrorReference {
    std::vector<std::array<Moments, 3>> pixels;

    explicit ErrorReference(const RunSeries& series);
    explicit ErrorReference(const ReferenceImage& image);
};

/// RMSE of the mean of 1, 2, 4 … runs, each over as many groups of runs as there are.
std::vector<ErrorOfRuns> errors_of_runs(const RunSeries& series, const ErrorReference& reference);
/// By least squares in logarithms.
std::optional<double> error_slope(const std::vector<ErrorOfRuns>& errors);

}  // namespace etendue
