#pragma once
// Statistics of errors: rates of convergence, means over runs and efficiencies, with confidence intervals.

#include <optional>
#include <span>

#include "math/statistics.h"

namespace etendue {

/// A value and its two-sided 95 % confidence interval.
struct Interval {
    double value = 0, low = 0, high = 0;
};

/// Mean of independent measurements with the interval of Student's t; empty for fewer than two.
std::optional<Interval> mean_interval(std::span<const double> samples);

/// error ≈ factor · time^slope, fitted by least squares of the logarithms. For an unbiased estimator with finite
/// variance the slope is −1/2 for RMSE and −1 for squared errors.
struct PowerLaw {
    double slope = 0, factor = 0;
    int points = 0;
};
/// Fits the points, ordered by time, with positive errors and times of at least `from`; empty for fewer than three.
std::optional<PowerLaw> fit_power_law(std::span<const double> times, std::span<const double> errors,
                                      double from = 0);

/// Efficiency 1 / (squared error · time) [Veach 1997, §2.3.2] of a method relative to another one, from the products of
/// squared error and time of their runs. The interval, for two runs or more, assumes normally distributed logarithms.
/// Empty where the mean of the products is not positive.
struct Efficiency {
    double value = 0;
    std::optional<Interval> interval;
};
std::optional<Efficiency> relative_efficiency(std::span<const double> base,
                                              std::span<const double> method);

/// Interval of the ratio X / R of two independent means, from the squares of their relative standard errors. It is infinite
/// where one of them is. The squares of the two half widths are added: with few samples of one mean and many of the other, the degrees of
/// freedom of Welch make it too narrow.
Interval ratio_interval(double ratio, const SquaredError& x, const SquaredError& r);

}  // namespace etendue
