#include "compare/error_statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/vec.h"

namespace etendue {
namespace {

struct Mean {
    double value = 0;
    double variance = 0;  ///< Variance of the mean; 0 for a single sample.

    explicit Mean(std::span<const double> samples) {
        const double n = double(samples.size());
        for (double v : samples) value += v / n;
        if (n < 2) return;
        for (double v : samples) variance += (v - value) * (v - value) / (n * (n - 1));
    }
};

}  // namespace

std::optional<Interval> mean_interval(std::span<const double> samples) {
    if (samples.size() < 2) return {};
    const Mean m(samples);
    const double half = student_quantile(0.05, double(samples.size() - 1)) * std::sqrt(m.variance);
    return Interval{m.value, m.value - half, m.value + half};
}

std::optional<PowerLaw> fit_power_law(std::span<const double> times, std::span<const double> errors,
                                      double from) {
    std::vector<double> x, y;
    for (size_t i = 0; i < times.size(); ++i) {
        if (!(times[i] >= from) || !(times[i] > 0) || !(errors[i] > 0)) continue;
        x.push_back(std::log(times[i]));
        y.push_back(std::log(errors[i]));
    }
    if (x.size() < 3 || x.front() == x.back()) return {};
    const double x_mean = Mean(x).value, y_mean = Mean(y).value;
    double xx = 0, xy = 0;
    for (size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - x_mean) * (x[i] - x_mean);
        xy += (x[i] - x_mean) * (y[i] - y_mean);
    }
    const double slope = xy / xx;
    return PowerLaw{slope, std::exp(y_mean - slope * x_mean), int(x.size())};
}

std::optional<Efficiency> relative_efficiency(std::span<const double> base,
                                              std::span<const double> method) {
    const Mean c0(base), c1(method);
    if (!(c0.value > 0) || !(c1.value > 0)) return {};
    Efficiency out{c0.value / c1.value, {}};
    const size_t runs = std::min(base.size(), method.size());
    if (runs < 2) return out;
    // To first order the variance of log c is var(c) / c². The degrees of freedom are those of the side with fewer
    // runs.
    const double spread =
        std::sqrt(c0.variance / (c0.value * c0.value) + c1.variance / (c1.value * c1.value));
    const double factor = std::exp(student_quantile(0.05, double(runs - 1)) * spread);
    out.interval = Interval{out.value, out.value / factor, out.value * factor};
    return out;
}

Interval ratio_interval(double ratio, const SquaredError& x, const SquaredError& r) {
    double squared = 0;
    for (const SquaredError& e : {x, r})
        // The quantile of unknown errors does not exist.
        squared += std::isfinite(e.value) && e.value > 0
                       ? sqr(student_quantile(0.05, e.dof)) * e.value
                       : e.value;
    const double half = std::isfinite(squared) ? std::fabs(ratio) * std::sqrt(squared) : squared;
    return {ratio, ratio - half, ratio + half};
}

}  // namespace etendue
