#include "math/statistics.h"

#include <algorithm>
#include <limits>

namespace etendue {

double student_tail(double t, double dof) {
    // With T = √ν tan θ the density is ∝ cos^(ν-1) θ; beyond ten standard deviations of θ nothing is left.
    constexpr int kSteps = 4000;
    const double lo = std::atan(t / std::sqrt(dof));
    const double step = std::min(M_PI / 2 - lo, 10 / std::sqrt(dof)) / kSteps;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
        sum += std::pow(std::cos(lo + (i + 0.5) * step), dof - 1) * step;
    const double half =
        std::sqrt(M_PI) / 2 * std::exp(std::lgamma(dof / 2) - std::lgamma((dof + 1) / 2));
    return std::min(1.0, sum / half);
}

double student_quantile(double p, double dof) {
    double lo = 0, hi = 1;
    while (student_tail(hi, dof) > p && hi < 1e9) hi *= 2;
    for (int i = 0; i < 50; ++i) {
        const double mid = 0.5 * (lo + hi);
        (student_tail(mid, dof) > p ? lo : hi) = mid;
    }
    return 0.5 * (lo + hi);
}

double welch_dof(const Moments& a, const Moments& b) {
    const double va = a.squared_error(), vb = b.squared_error();
    double denominator = 0;
    if (va > 0) denominator += va * va / double(a.count() - 1);
    if (vb > 0) denominator += vb * vb / double(b.count() - 1);
    return denominator > 0 ? (va + vb) * (va + vb) / denominator
                           : std::numeric_limits<double>::infinity();
}

double welch_p(const Moments& a, const Moments& b, double tolerance) {
    const double difference = std::max(0.0, std::fabs(a.mean() - b.mean()) - tolerance);
    const double v = a.squared_error() + b.squared_error();
    if (!(v > 0)) return difference > 0 ? 0 : 1;
    return student_tail(difference / std::sqrt(v), welch_dof(a, b));
}

double sidak(double family, int tests) {
    return 1 - std::pow(1 - family, 1.0 / tests);
}

}  // namespace etendue
