#include "math/statistics.h"

#include <algorithm>

#include <boost/math/distributions/students_t.hpp>

namespace etendue {
namespace {

/// Returns infinity or NaN instead of throwing where there is no finite value.
using NoThrow = boost::math::policies::policy<
    boost::math::policies::domain_error<boost::math::policies::ignore_error>,
    boost::math::policies::overflow_error<boost::math::policies::ignore_error>>;
using StudentsT = boost::math::students_t_distribution<double, NoThrow>;

}  // namespace

double weighted_median(std::vector<WeightedValue> values) {
    std::sort(values.begin(), values.end(),
              [](const auto& a, const auto& b) { return a.value < b.value; });
    double sum = 0, below = 0;
    for (const WeightedValue& v : values) sum += v.weight;
    for (const WeightedValue& v : values)
        if ((below += v.weight) >= sum / 2) return v.value;
    return 0;
}

double student_tail(double t, double dof) {
    return 2 * cdf(complement(StudentsT(dof), t));
}

double student_quantile(double p, double dof) {
    return quantile(complement(StudentsT(dof), p / 2));
}

SquaredError sum(std::span<const SquaredError> errors) {
    SquaredError all;
    double denominator = 0;
    for (const SquaredError& e : errors) {
        all.value += e.value;
        if (e.value > 0) denominator += e.value * e.value / e.dof;
    }
    if (denominator > 0) all.dof = all.value * all.value / denominator;
    return all;
}

double welch_dof(const Moments& a, const Moments& b) {
    const SquaredError errors[] = {{a.squared_error(), double(a.count() - 1)},
                                   {b.squared_error(), double(b.count() - 1)}};
    return sum(errors).dof;
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
