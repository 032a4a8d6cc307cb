#pragma once
// What a comparison concludes from errors: rates of convergence, means over runs, efficiencies, and how sure they are.

#include <optional>
#include <span>

namespace etendue {

/// A value and its two-sided 95 % confidence interval.
struct Interval {
    double value = 0, low = 0, high = 0;
};

/// Mean of independent measurements with Student's interval; none where there are fewer than two.
std::optional<Interval> mean_interval(std::span<const double> samples);

/// error ≈ factor · time^slope, by least squares of the logarithms. RMSE falls with slope −1/2, squared errors with −1,
/// where an estimator is unbiased and its variance finite.
struct PowerLaw {
    double slope = 0, factor = 0;
    int points = 0;
};
/// Of the points, in order of time, with positive errors and times of at least `from`; none where fewer than three
/// remain.
std::optional<PowerLaw> fit_power_law(std::span<const double> times, std::span<const double> errors,
                                      double from = 0);

/// One method's squared errors over its runs, and the time of one run.
struct Cost {
    std::span<const double> squared_errors;
    double seconds;
};
/// Efficiency is 1 / (squared error · time) [Veach 1997, §2.3.2]: that of `method` over that of `base`. With two runs or
/// more the interval is known; it treats the logarithms as normal. None where an error is not positive.
struct Efficiency {
    double value = 0;
    std::optional<Interval> interval;
};
std::optional<Efficiency> relative_efficiency(const Cost& base, const Cost& method);

/// Of a ratio X / R of two independent means, from their relative standard errors.
Interval ratio_interval(double ratio, double relative_error_x, double relative_error_r);

}  // namespace etendue
