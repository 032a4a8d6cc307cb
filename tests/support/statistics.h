#pragma once
// Estimates with their spread, and the tests that compare them. Every test states the rate at which it raises a false
// alarm; seeds are fixed, so that a test that passes keeps passing.

#include <cmath>
#include <cstdint>

namespace etendue::test {

/// Mean and spread of independent samples of one quantity [Welford 1962].
class Moments {
public:
    /// A quantity that is known.
    static Moments exact(double value) {
        Moments m;
        m.mean_ = value;
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

/// Probability that |T| exceeds t for Student's distribution: with T = √ν tan θ its density is ∝ cos^(ν-1) θ.
inline double student_tail(double t, double dof) {
    constexpr int kSteps = 4000;
    // Beyond ten standard deviations of θ nothing is left.
    const double lo = std::atan(t / std::sqrt(dof));
    const double step = std::fmin(M_PI / 2 - lo, 10 / std::sqrt(dof)) / kSteps;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
        sum += std::pow(std::cos(lo + (i + 0.5) * step), dof - 1) * step;
    const double half =
        std::sqrt(M_PI) / 2 * std::exp(std::lgamma(dof / 2) - std::lgamma((dof + 1) / 2));
    return std::fmin(1, sum / half);
}

/// Welch's test: the probability of means at least this different, where the expectations differ by at most
/// `tolerance` (for what single precision does to a render, which no number of samples averages out).
inline double welch_p(const Moments& a, const Moments& b, double tolerance) {
    const double difference = std::fmax(0, std::fabs(a.mean() - b.mean()) - tolerance);
    const double va = a.squared_error(), vb = b.squared_error();
    if (!(va + vb > 0)) return difference > 0 ? 0 : 1;
    double denominator = 0;
    if (va > 0) denominator += va * va / double(a.count() - 1);
    if (vb > 0) denominator += vb * vb / double(b.count() - 1);
    return student_tail(difference / std::sqrt(va + vb), (va + vb) * (va + vb) / denominator);
}

}  // namespace etendue::test
