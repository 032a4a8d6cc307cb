#include <gtest/gtest.h>

#include "chi2.h"
#include "guide/mixture.h"
#include "math/frame.h"
#include "math/warp.h"
#include "random.h"

namespace etendue {
namespace {

using testing::Random;

GuideMixture random_mixture(Random& random, int lobes, float kappa) {
    GuideMixture m;
    for (int k = 0; k < lobes; ++k) {
        const Vec3 mean = sample_uniform_sphere(random.next_2d());
        const float weight = 0.1f + random.next_1d(), inv_r = k % 3 == 0 ? 0.0f : random.next_1d();
        m.add({mean, inv_r, kappa, weight});
    }
    return m;
}

struct Case {
    int lobes;
    float kappa;
    bool is_one_sided;
};

class Density : public ::testing::TestWithParam<Case> {};

/// Around the most probable lobe, where a narrow one is resolved.
TEST_P(Density, IsThatOfSamples) {
    const auto [lobes, kappa, is_one_sided] = GetParam();
    Random random(7);
    const GuideMixture m = random_mixture(random, lobes, kappa);
    const GuideView view{{0.3f, -0.2f, 0.4f}, is_one_sided ? Vec3{0, 0.6f, 0.8f} : Vec3{}};
    const GuideMixture::Lobe lobe = m.lobe(0);
    const Frame frame = Frame::from_normal(lobe.mean);
    // 1 - cos θ up to some widths of the lobe.
    const double reach = std::min(2.0, 8.0 / double(kappa));
    testing::Chi2Grid grid(0, reach, 16, 0, 2 * M_PI, 16);
    for (int i = 0; i < 200000; ++i) {
        const float u = random.next_1d();
        const Vec3 w = m.sample(view, u, random.next_2d());
        ASSERT_NEAR(length2(w), 1, 1e-5);
        const Vec3 v = frame.to_local(w);
        const double phi = std::atan2(double(v.y), double(v.x));
        grid.add(0.5 * double(length2(w - lobe.mean)), phi < 0 ? phi + 2 * M_PI : phi);
    }
    const auto result = grid.test([&](double versine, double phi) {
        const double sin = std::sqrt(versine * (2 - versine));
        const Vec3 w = frame.to_world(
            {float(sin * std::cos(phi)), float(sin * std::sin(phi)), float(1 - versine)});
        return double(m.pdf(view, w));
    });
    EXPECT_GT(result.p_value, 1e-3) << result.total_probability;
    EXPECT_GT(result.total_probability, 0.01);
}

TEST_P(Density, IntegratesToOne) {
    const auto [lobes, kappa, is_one_sided] = GetParam();
    if (kappa > 300) return;  // The narrower ones are tested around their lobes.
    Random random(8);
    const GuideMixture m = random_mixture(random, lobes, kappa);
    const GuideView view{{0.3f, -0.2f, 0.4f}, is_one_sided ? Vec3{1, 0, 0} : Vec3{}};
    constexpr int kSteps = 600;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < 2 * kSteps; ++j) {
            const double z = -1 + 2 * (i + 0.5) / kSteps, phi = M_PI * (j + 0.5) / kSteps,
                         r = std::sqrt(1 - z * z);
            sum +=
                double(m.pdf(view, {float(r * std::cos(phi)), float(r * std::sin(phi)), float(z)}));
        }
    EXPECT_NEAR(sum * 4 * M_PI / (2.0 * kSteps * kSteps), 1, 2e-3);
}

TEST_P(Density, IsBelowBoundOfCone) {
    const auto [lobes, kappa, is_one_sided] = GetParam();
    Random random(9);
    const GuideMixture m = random_mixture(random, lobes, kappa);
    const GuideView view{{0.3f, -0.2f, 0.4f}, is_one_sided ? Vec3{1, 0, 0} : Vec3{}};
    for (int i = 0; i < 2000; ++i) {
        // Half of the cones near a lobe.
        const Vec3 any = sample_uniform_sphere(random.next_2d());
        const Vec3 near = normalize(m.lobe(i % lobes).mean + any * (4 / std::sqrt(kappa)));
        const float angle = 1.4f * std::pow(random.next_1d(), 4.0f) + 1e-4f;
        const DirectionCone cone{i % 2 ? any : near, angle};
        const float bound = m.max_pdf(view, cone);
        for (int k = 0; k < 50; ++k) {
            const float r = std::tan(angle) * random.next_1d(), phi = random.between(0, 2 * kPi);
            const Vec3 w =
                Frame::from_normal(cone.axis).to_world({r * std::cos(phi), r * std::sin(phi), 1});
            ASSERT_LE(m.pdf(view, normalize(w)), bound * 1.0001f) << angle;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Mixtures, Density,
                         ::testing::Values(Case{1, 0.02f, false}, Case{1, 5, true},
                                           Case{8, 20, true}, Case{16, 200, false},
                                           Case{16, 200, true}, Case{11, 1e3f, true},
                                           Case{16, 1e4f, true}, Case{3, 1e4f, false}));

/// The bound holds also where a lobe is nearly opposite to the cone's axis.
TEST(GuideMixture, IsBelowBoundOfOppositeCone) {
    for (const float kappa : {1.0f, 10.0f, 30.0f}) {
        GuideMixture m;
        m.add({{0, 0, 1}, 0, kappa, 1});
        for (float beside = 1e-5f; beside < 0.1f; beside *= 1.3f)
            for (const double angle : {0.3, 1.0, 1.5}) {
                const DirectionCone cone{normalize({beside, 0, -1}), float(angle)};
                // The direction of the cone that is nearest to the lobe.
                const double edge = M_PI - std::atan(double(beside)) - angle;
                const float pdf = m.pdf({}, {float(std::sin(edge)), 0, float(std::cos(edge))});
                EXPECT_LE(pdf, m.max_pdf({}, cone)) << kappa << ", " << beside << ", " << angle;
                EXPECT_GT(pdf, 0.999f * m.max_pdf({}, cone)) << kappa << ", " << beside;
            }
    }
}

TEST(GuideMixture, LobesTurnTowardTheirOrigin) {
    GuideMixture m;
    m.add({{0, 0, 1}, 0.5f, 1e4f, 1});  // The origin is two units above the centre.
    const Vec3 from{1, 0, 0};
    const GuideView view{-from, {}};
    EXPECT_GT(m.pdf(view, normalize({-1, 0, 2})), 1000);
    EXPECT_LT(m.pdf(view, {0, 0, 1}), 1e-6f);
    // At the origin itself, the lobe keeps its direction.
    EXPECT_GT(m.pdf({{0, 0, -2}, {}}, {0, 0, 1}), 1000);
}

TEST(GuideMixture, PrefersLobesAboveTheSurface) {
    GuideMixture m;
    m.add({{0, 0, 1}, 0, 100, 1});
    m.add({{0, 0, -1}, 0, 100, 9});
    const GuideView view{{}, {0, 0, 1}};
    EXPECT_GT(m.pdf(view, {0, 0, 1}), 50 * m.pdf(view, {0, 0, -1}));
}

}  // namespace
}  // namespace etendue
