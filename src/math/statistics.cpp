#include "math/statistics.h"

#include <algorithm>
#include <limits>

namespace etendue {

namespace {

/// The continued fraction of the incomplete beta function I_x(a,b) [NIST DLMF, 8.17.22] by Lentz's method.
double beta_fraction(double x, double a, double b) {
    double value = 1, c = 1, d = 0;
    for (int i = 1; i < 10000; ++i) {
        const double m = i / 2;
        const double term = i % 2 ? -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
                                  : m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        d = 1 / (1 + term * d);
        c = 1 + term / c;
        value *= c * d;
        if (std::fabs(c * d - 1) < 1e-15) break;
    }
    return 1 / value;
}

}  // namespace

double student_tail(double t, double dof) {
    // The normal distribution to a relative t⁴ / 4ν.
    if (dof > 1e6) return std::erfc(t / std::sqrt(2.0));
    // I_x(ν/2, 1/2) with x = ν / (ν + t²) [NIST DLMF, 8.17.17].
    const double a = dof / 2, b = 0.5, x = dof / (dof + t * t), y = t * t / (dof + t * t);
    const double front =
        std::exp(std::lgamma(a + b) - std::lgamma(a) - a * std::log1p(t * t / dof)) *
        std::sqrt(y / M_PI);
    return x < (a + 1) / (a + b + 2) ? front / a * beta_fraction(x, a, b)
                                     : 1 - front / b * beta_fraction(y, b, a);
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
