#pragma once
// One comparison of a method with its reference, by Welch's t-test.

#include "math/statistics.h"

namespace etendue {

struct WelchTest {
    /// Effective contributions (see Tally::effective_count()) that a t-test needs on either side.
    static constexpr double kEnoughContributions = 200;
    /// What rounding may do to a mean, relative.
    static constexpr double kRounding = 1e-4;

    Moments method, reference;   ///< Over independent runs.
    double effective_count = 0;  ///< Of the side that has fewer.
    double p = 1;

    /// `effective_count` 0: no test.
    static WelchTest of(const Moments& method, const Moments& reference, double effective_count);

    bool is_tested() const;
    double ratio() const { return method.mean() / reference.mean(); }
    /// Standard error of the ratio.
    double ratio_error() const;
    /// Relative error that a test at this level finds with a probability of 90 %.
    double detectable(double level) const;
};

}  // namespace etendue
