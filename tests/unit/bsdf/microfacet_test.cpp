// Facet distributions. False-alarm rate of the χ² tests together: 0.1 %.

#include "bsdf/microfacet.h"

#include "lobe_tests.h"
#include "roughness.h"

namespace etendue {
namespace {

using testing::direction;
using testing::Roughness;

constexpr Roughness kAlphaPairs[] = {{1, 1},           {0.5f, 0.5f},  {0.1f, 0.1f},
                                     {0.001f, 0.001f}, {0.4f, 0.08f}, {0.05f, 0.8f}};
constexpr double kAngles[] = {0, 30, 60, 85, 89.5};

class MicrofacetOf : public ::testing::TestWithParam<Microfacet::Kind> {};
INSTANTIATE_TEST_SUITE_P(Both, MicrofacetOf,
                         ::testing::Values(Microfacet::Kind::Beckmann, Microfacet::Kind::Ggx),
                         [](const auto& kind) {
                             return kind.param == Microfacet::Kind::Ggx ? "Ggx" : "Beckmann";
                         });

/// ∫ f(m) dω over normals, in the slopes' own scale so that the peak is as wide for every
/// roughness.
template <class F>
double integrate_normals(const Microfacet& d, const F& f) {
    const auto g = [&](double a, double phi) {
        // tan θ of a normal of unit roughness runs over [0, ∞) as a / (1 − a).
        const double r = a / (1 - a), dr = 1 / ((1 - a) * (1 - a));
        const double x = d.alpha_x() * r * std::cos(phi), y = d.alpha_y() * r * std::sin(phi);
        const double len2 = 1 + x * x + y * y, len = std::sqrt(len2);
        const Vec3 m = normalize({float(x / len), float(y / len), float(1 / len)});
        // dω = cos³ θ dx dy
        return double(f(m)) / (len2 * len) * d.alpha_x() * d.alpha_y() * r * dr;
    };
    return testing::integrate_2d(g, 0, 1, 0, 2 * M_PI, 1e-6, 5);
}

TEST_P(MicrofacetOf, ProjectedAreaOfNormalsIsOne) {
    for (const Roughness a : kAlphaPairs) {
        const Microfacet d(GetParam(), a.x, a.y);
        EXPECT_NEAR(integrate_normals(d, [&](Vec3 m) { return d.D(m) * m.z; }), 1, 1e-3)
            << a.x << " " << a.y;
    }
}

TEST_P(MicrofacetOf, SigmaIsTheProjectedAreaOfFacingNormals) {
    for (const Roughness a : kAlphaPairs)
        for (const double theta : kAngles) {
            const Microfacet d(GetParam(), a.x, a.y);
            const Vec3 w = direction(theta, 35);
            const double area =
                integrate_normals(d, [&](Vec3 m) { return std::max(dot(w, m), 0.0f) * d.D(m); });
            EXPECT_NEAR(d.sigma(w) / area, 1, 2e-3) << a.x << " " << a.y << " at " << theta;
            EXPECT_FLOAT_EQ(d.sigma(w), d.sigma(-w));
        }
}

TEST_P(MicrofacetOf, VisibleNormalsFollowTheirDensity) {
    const double significance = sidak(1e-3, 2 * int(std::size(kAlphaPairs) * std::size(kAngles)));
    for (const Roughness a : kAlphaPairs)
        for (const double theta : kAngles) {
            const Microfacet d(GetParam(), a.x, a.y);
            const Vec3 w = direction(theta, 35);
            // Cells in the slopes (x, y), scaled to unit roughness and squeezed to (−1, 1).
            const auto squeeze = [](double s) { return s / (1 + std::fabs(s)); };
            testing::Chi2Grid grid(-1, 1, 16, -1, 1, 16);
            testing::LobeRandom random(11);
            for (int i = 0; i < 50000; ++i) {
                const Vec3 m = d.sample_visible(w, random.next_2d());
                ASSERT_NEAR(length(m), 1, 1e-6);
                ASSERT_GT(m.z, 0);
                grid.add(squeeze(m.x / m.z / d.alpha_x()), squeeze(m.y / m.z / d.alpha_y()));
            }
            const auto density = [&](double a_x, double a_y) {
                const double sx = a_x / (1 - std::fabs(a_x)) * d.alpha_x(),
                             sy = a_y / (1 - std::fabs(a_y)) * d.alpha_y();
                const double len2 = 1 + sx * sx + sy * sy, len = std::sqrt(len2);
                const Vec3 m{float(sx / len), float(sy / len), float(1 / len)};
                return double(d.pdf_visible(w, m)) / (len2 * len) * d.alpha_x() * d.alpha_y() /
                       ((1 - std::fabs(a_x)) * (1 - std::fabs(a_x)) * (1 - std::fabs(a_y)) *
                        (1 - std::fabs(a_y)));
            };
            const testing::Chi2Result r = grid.test(density, 1);
            EXPECT_GE(r.p_value, significance) << a.x << " " << a.y << " at " << theta << ": chi2 "
                                               << r.statistic << " / " << r.degrees;
            EXPECT_NEAR(r.total_probability, 1, 2e-3) << a.x << " " << a.y << " at " << theta;
        }
}

TEST_P(MicrofacetOf, ExtremeRandomNumbersGiveUnitNormals) {
    const Microfacet d(GetParam(), 0.3f, 0.2f);
    for (const double theta : kAngles)
        for (float a : {0.0f, 0x1p-24f, 0.5f, kOneMinusEpsilon})
            for (float b : {0.0f, 0x1p-24f, 0.5f, kOneMinusEpsilon}) {
                const Vec3 m = d.sample_visible(direction(theta, 100), {a, b});
                EXPECT_TRUE(is_finite(m) && m.z > 0 && std::fabs(length(m) - 1) < 1e-6);
            }
}

TEST(Microfacet, RoughnessIsClamped) {
    const Microfacet d(Microfacet::Kind::Ggx, 0, 1e9f);
    EXPECT_EQ(d.alpha_x(), Microfacet::kMinAlpha);
    EXPECT_EQ(d.alpha_y(), Microfacet::kMaxAlpha);
}

}  // namespace
}  // namespace etendue
