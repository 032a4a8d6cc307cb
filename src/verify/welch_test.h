#pragma once
// One comparison of a method with its reference, by Welch's t-test.

#include "math/statistics.h"

namespace etendue {

struct WelchTest {
    /// Effective contributions (see Tally::effective_count()) that a t-test needs on each side.
    static constexpr double kEnoughContributions = 200;
    /// Relative error of a mean that is attributed to rounding in single precision.
    static constexpr double kRounding = 1e-4;
    /// The same of means of half floats, whose significands have 11 bits, rounded to the nearest.
    static constexpr double kHalfRounding = 0x1p-11;

    Moments method, reference;  ///< Over independent runs.
    double effective_count =
        0;  ///< Of the side with fewer contributions; below kEnoughContributions nothing is tested.
    double p = 1;
    double rounding = kRounding;  ///< Relative error of the means that the test tolerates.

    /// Welch's test of the two means.
    static WelchTest of(const Moments& method, const Moments& reference, double effective_count,
                        double rounding = kRounding);

    bool is_tested() const;
    double ratio() const { return method.mean() / reference.mean(); }
    /// Standard error of the ratio.
    double ratio_error() const;
    /// Smallest relative error that a test at this significance level finds with a probability of 90 %.
    double detectable(double level) const;
};

}  // namespace etendue
