#pragma once
// Pearson's χ² test of samples against a density, on cells of a two-dimensional domain, and what it
// needs: adaptive quadrature and the incomplete gamma function.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "math/statistics.h"

namespace etendue::testing {

/// Regularised upper incomplete gamma function Q(a, x) by series or continued fraction [Press et
/// al. 2007, §6.2].
inline double gamma_q(double a, double x) {
    if (!(x > 0)) return 1;
    const double scale = std::exp(-x + a * std::log(x) - std::lgamma(a));
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (double n = a + 1; term > sum * 1e-15; n += 1) sum += term *= x / n;
        return 1 - sum * scale;
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int i = 1; i < 10000; ++i) {
        const double an = -i * (i - a);
        b += 2;
        d = 1 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (std::fabs(c * d - 1) < 1e-15) break;
    }
    return h * scale;
}

/// ∫∫ f over [x0, x1] × [y0, y1] to about the absolute error `tolerance`: 2×2 against 4 × (2×2)
/// Gauss points, subdivided where they differ. The subdivision has at least `min_depth` levels, so that narrow peaks
/// are not missed; a limit on its cost ends it where the integral diverges.
template <class F>
double integrate_2d(const F& f, double x0, double x1, double y0, double y1, double tolerance,
                    int min_depth = 1) {
    constexpr int kMaxDepth = 12, kMaxCells = 2000;
    int cells = 0;
    const auto gauss = [&](double ax, double bx, double ay, double by) {
        constexpr double g = 0.57735026918962576451;
        const double cx = 0.5 * (ax + bx), hx = 0.5 * (bx - ax), cy = 0.5 * (ay + by),
                     hy = 0.5 * (by - ay);
        return hx * hy *
               (f(cx - g * hx, cy - g * hy) + f(cx + g * hx, cy - g * hy) +
                f(cx - g * hx, cy + g * hy) + f(cx + g * hx, cy + g * hy));
    };
    const auto recurse = [&](const auto& self, double ax, double bx, double ay, double by,
                             double whole, double tol, int depth) -> double {
        const double mx = 0.5 * (ax + bx), my = 0.5 * (ay + by);
        const double q[4] = {gauss(ax, mx, ay, my), gauss(mx, bx, ay, my), gauss(ax, mx, my, by),
                             gauss(mx, bx, my, by)};
        const double sum = q[0] + q[1] + q[2] + q[3];
        if (depth >= min_depth &&
            (std::fabs(sum - whole) < tol || depth >= kMaxDepth || ++cells > kMaxCells))
            return sum;
        return self(self, ax, mx, ay, my, q[0], tol / 2, depth + 1) +
               self(self, mx, bx, ay, my, q[1], tol / 2, depth + 1) +
               self(self, ax, mx, my, by, q[2], tol / 2, depth + 1) +
               self(self, mx, bx, my, by, q[3], tol / 2, depth + 1);
    };
    return recurse(recurse, x0, x1, y0, y1, gauss(x0, x1, y0, y1), tolerance, 0);
}

struct Chi2Result {
    double statistic = 0;
    int degrees = 0;
    double p_value = 1;
    double total_probability = 0;  ///< Σ of the cells' probabilities.
};

/// Pearson's test of `counts` among `samples` draws against cell probabilities; draws outside all cells form one more
/// cell. Cells that expect fewer than five draws are pooled; a pool that is still that small passes unless it contains
/// too many.
inline Chi2Result chi2_test(const std::vector<int64_t>& counts,
                            const std::vector<double>& probabilities, int64_t samples) {
    struct Cell {
        double expected;
        double observed;
    };
    std::vector<Cell> cells;
    Chi2Result result;
    double rest = double(samples);
    for (size_t i = 0; i < counts.size(); ++i) {
        cells.push_back({probabilities[i] * double(samples), double(counts[i])});
        result.total_probability += probabilities[i];
        rest -= double(counts[i]);
    }
    cells.push_back({std::max(0.0, 1 - result.total_probability) * double(samples), rest});
    std::sort(cells.begin(), cells.end(), [](Cell a, Cell b) { return a.expected < b.expected; });

    constexpr double kMinExpected = 5;
    Cell pool{0, 0};
    int used = 0;
    const auto add = [&](Cell c) {
        result.statistic += (c.observed - c.expected) * (c.observed - c.expected) / c.expected;
        ++used;
    };
    for (const Cell& c : cells) {
        if (c.expected >= kMinExpected && (pool.expected == 0 || pool.expected >= kMinExpected)) {
            add(c);
            continue;
        }
        pool.expected += c.expected;
        pool.observed += c.observed;
        if (pool.expected >= kMinExpected) {
            add(pool);
            pool = {0, 0};
        }
    }
    // A remaining pool that expects almost none is tested by the Poisson tail instead of a term of the sum.
    double pool_p = 1;
    if (pool.observed > 0)
        pool_p = pool.expected > 0 ? 1 - gamma_q(pool.observed, pool.expected) : 0;
    result.degrees = std::max(1, used - 1);
    result.p_value =
        std::min(gamma_q(0.5 * result.degrees, 0.5 * result.statistic), std::min(1.0, 2 * pool_p));
    return result;
}

/// Samples counted on a grid of [x0, x1] × [y0, y1], tested against a density on the same domain.
class Chi2Grid {
public:
    Chi2Grid(double x0, double x1, int nx, double y0, double y1, int ny)
        : x0_(x0), x1_(x1), y0_(y0), y1_(y1), nx_(nx), ny_(ny), counts_(size_t(nx) * size_t(ny)) {}

    void add(double x, double y) {
        ++samples_;
        const int i = cell(x, x0_, x1_, nx_), j = cell(y, y0_, y1_, ny_);
        if (i >= 0 && j >= 0) ++counts_[size_t(j) * size_t(nx_) + size_t(i)];
    }
    /// Counts a draw without a result, or one that the density does not describe.
    void add_outside() { ++samples_; }

    /// `density(x, y)` integrates over the domain to the probability that a draw falls inside.
    template <class F>
    Chi2Result test(const F& density, int min_depth = 1) const {
        std::vector<double> probabilities;
        const double dx = (x1_ - x0_) / nx_, dy = (y1_ - y0_) / ny_;
        // The quadrature may be off by a small part of a cell's statistical error.
        const double tolerance = 0.02 / std::sqrt(double(samples_) * double(counts_.size()));
        for (int j = 0; j < ny_; ++j)
            for (int i = 0; i < nx_; ++i)
                probabilities.push_back(integrate_2d(density, x0_ + i * dx, x0_ + (i + 1) * dx,
                                                     y0_ + j * dy, y0_ + (j + 1) * dy, tolerance,
                                                     min_depth));
        return chi2_test(counts_, probabilities, samples_);
    }

private:
    static int cell(double x, double lo, double hi, int n) {
        if (!(x >= lo && x <= hi)) return -1;
        return std::min(n - 1, int((x - lo) / (hi - lo) * n));
    }

    double x0_, x1_, y0_, y1_;
    int nx_, ny_;
    int64_t samples_ = 0;
    std::vector<int64_t> counts_;
};

}  // namespace etendue::testing
