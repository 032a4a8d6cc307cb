#include "verify/welch_test.h"

#include <cmath>

namespace etendue {

WelchTest WelchTest::of(const Moments& method, const Moments& reference, double effective_count,
                        double rounding) {
    return {method, reference, effective_count,
            welch_p(method, reference, rounding * std::fabs(reference.mean())), rounding};
}

bool WelchTest::is_tested() const {
    return effective_count >= kEnoughContributions && (method.mean() != 0 || reference.mean() != 0);
}

double WelchTest::ratio_error() const {
    const double ratio = this->ratio();
    return std::sqrt(method.squared_error() + ratio * ratio * reference.squared_error()) /
           std::fabs(reference.mean());
}

double WelchTest::detectable(double level) const {
    const double error = std::sqrt(method.squared_error() + reference.squared_error());
    if (!(error > 0)) return rounding;
    const double dof = welch_dof(method, reference);
    // student_quantile() counts both tails: 0.2 leaves 10 % on one side.
    return rounding + (student_quantile(level, dof) + student_quantile(0.2, dof)) * error /
                          std::fabs(reference.mean());
}

}  // namespace etendue
