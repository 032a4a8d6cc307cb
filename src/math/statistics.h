#pragma once
// Means with their standard errors, and the tests that compare them.

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace etendue {

/// Mean and spread of independent samples of one quantity [Welford 1962].
class Moments {
public:
    /// A known value, without error.
    static Moments exact(double value) { return estimate(value, 0, 0); }
    /// The mean of `count` samples, and the variance of that mean.
    static Moments estimate(double mean, double squared_error, int64_t count) {
        Moments m;
        m.count_ = count;
        m.mean_ = mean;
        m.sum2_ = squared_error * double(count) * double(count - 1);
        return m;
    }
    void add(double x) {
        const double d = x - mean_;
        mean_ += d / double(++count_);
        sum2_ += d * (x - mean_);
    }
    int64_t count() const { return count_; }
    double mean() const { return mean_; }
    /// Of one sample.
    double variance() const { return count_ > 1 ? sum2_ / double(count_ - 1) : 0.0; }
    /// Of the mean.
    double squared_error() const { return count_ > 1 ? variance() / double(count_) : 0.0; }

private:
    int64_t count_ = 0;
    double mean_ = 0, sum2_ = 0;
};

struct WeightedValue {
    double value, weight;
};
/// The smallest value at which the values up to it have half of the total weight; 0 if there are none.
double weighted_median(std::vector<WeightedValue> values);

/// Probability that |T| exceeds t for Student's distribution with `dof` degrees of freedom.
double student_tail(double t, double dof);
/// The t whose student_tail() is `p`: the half-width, in standard errors, of a confidence interval of level 1 - p.
double student_quantile(double p, double dof);

/// Two-sided 95 % quantile of the normal distribution.
inline constexpr double kNormalQuantile95 = 1.959964;

/// Variance of a mean, estimated with some degrees of freedom: infinitely many where it is known.
struct SquaredError {
    double value = 0, dof = std::numeric_limits<double>::infinity();
};
inline constexpr SquaredError kUnknownError{std::numeric_limits<double>::infinity(), 0};
/// That of a sum or difference of independent means [Welch 1947].
SquaredError sum(std::span<const SquaredError> errors);

/// Degrees of freedom of the difference of two means [Welch 1947]; infinite where both are exact.
double welch_dof(const Moments& a, const Moments& b);
/// p-value of Welch's test: the probability of means that differ at least as much as these if the expectations differ
/// by `tolerance`, which allows for rounding errors of single precision that no number of samples averages out.
double welch_p(const Moments& a, const Moments& b, double tolerance);

/// Significance level of each of `tests` independent tests for which the probability of at least one false alarm is
/// `family` [Šidák 1967].
double sidak(double family, int tests);

}  // namespace etendue
