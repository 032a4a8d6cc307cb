// Tests of the χ² helpers: they accept correct densities and reject slightly wrong ones.

#include "chi2.h"

#include <gtest/gtest.h>

#include <random>

namespace etendue::testing {
namespace {

TEST(Chi2, GammaQMatchesClosedForms) {
    for (double x : {0.01, 0.5, 1.0, 3.0, 20.0}) {
        EXPECT_NEAR(gamma_q(1, x), std::exp(-x), 1e-13);
        EXPECT_NEAR(gamma_q(0.5, x), std::erfc(std::sqrt(x)), 1e-13);
        EXPECT_NEAR(gamma_q(2, x), (1 + x) * std::exp(-x), 1e-13);
    }
    EXPECT_NEAR(gamma_q(50, 50), 0.4811916844, 1e-9);
}

TEST(Chi2, QuadratureFindsPeaksAndSteps) {
    const auto peak = [](double x, double y) {
        const double s = 0.01, dx = x - 0.3, dy = y - 0.6;
        return std::exp(-(dx * dx + dy * dy) / (2 * s * s)) / (2 * M_PI * s * s);
    };
    EXPECT_NEAR(integrate_2d(peak, 0, 1, 0, 1, 1e-6, 4), 1, 1e-5);
    EXPECT_NEAR(
        integrate_2d([](double x, double y) { return x + y < 0.7 ? 1.0 : 0.0; }, 0, 1, 0, 1, 1e-5),
        0.245, 2e-3);
}

/// p-value for draws of density 2x on [0, 1]², with a tenth of them lost, against (2 + tilt·(y −
/// ½)) x of the rest.
double p_value(uint64_t seed, double tilt) {
    std::mt19937_64 engine(seed);
    std::uniform_real_distribution<double> uniform;
    Chi2Grid grid(0, 1, 10, 0, 1, 10);
    for (int i = 0; i < 20000; ++i) {
        const double x = std::sqrt(uniform(engine)), y = uniform(engine);
        if (uniform(engine) < 0.1)
            grid.add_outside();
        else
            grid.add(x, y);
    }
    return grid.test([&](double x, double y) { return 0.9 * (2 + tilt * (y - 0.5)) * x; }).p_value;
}

TEST(Chi2, PValuesOfTheRightDensityAreUniform) {
    // Kolmogorov-Smirnov at a false-alarm rate of 0.1 %.
    std::vector<double> p;
    for (uint64_t seed = 0; seed < 200; ++seed) p.push_back(p_value(seed, 0));
    std::sort(p.begin(), p.end());
    double distance = 0;
    for (size_t i = 0; i < p.size(); ++i)
        distance = std::max(
            {distance, std::fabs(p[i] - double(i) / 200), std::fabs(p[i] - double(i + 1) / 200)});
    EXPECT_LT(distance, 1.95 / std::sqrt(200.0));
}

TEST(Chi2, RejectsADensityThatIsSixPercentOff) {
    EXPECT_LT(p_value(1, 0.4), 1e-4);
}

TEST(Chi2, RejectsSamplesWhereTheDensityIsZero) {
    EXPECT_LT(chi2_test({500, 490, 10}, {0.5, 0.5, 0}, 1000).p_value, 1e-6);
    EXPECT_GT(chi2_test({500, 500, 0}, {0.5, 0.5, 0}, 1000).p_value, 0.5);
    // Lost samples: the cells' probabilities sum to one, but every tenth draw fell in none.
    EXPECT_LT(chi2_test({450, 450}, {0.5, 0.5}, 1000).p_value, 1e-6);
}

}  // namespace
}  // namespace etendue::testing
