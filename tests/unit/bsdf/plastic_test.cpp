// Smooth and rough plastic. False-alarm rate of the χ² tests of each TEST: 0.1 %.

#include "bsdf/plastic.h"

#include <thread>

#include <fmt/format.h>

#include "bsdf/roughdielectric.h"
#include "bsdf/roughplastic.h"
#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

const Rgb kWood(0.7f, 0.4f, 0.2f);

/// The lobe that a material of one component has on the plane z = 0.
template <class L>
L lobe_of(const Material& material) {
    ComponentArena arena;
    return std::get<L>(material.bsdf(plane_point({0, 0, 1}), arena).front().lobe);
}

class PlasticTest : public ::testing::Test {
protected:
    PlasticLobe smooth(Rgb diffuse, bool nonlinear = false, double ior = 1.5) {
        return lobe_of<PlasticLobe>(materials_.make(
            "plastic",
            {{"diffuse_reflectance", diffuse}, {"nonlinear", nonlinear}, {"int_ior", ior}}));
    }
    RoughPlasticLobe rough(const char* distribution, double alpha, Rgb diffuse,
                           bool nonlinear = false) {
        return lobe_of<RoughPlasticLobe>(
            materials_.make("roughplastic", {{"distribution", std::string(distribution)},
                                             {"alpha", alpha},
                                             {"diffuse_reflectance", diffuse},
                                             {"nonlinear", nonlinear}}));
    }

private:
    TestMaterials materials_;
};

TEST_F(PlasticTest, SmoothSamplesMatchPdf) {
    const double significance = sidak(1e-3, int(2 * test_directions().size()));
    for (Vec3 wo : test_directions()) expect_samples_match_pdf(smooth(kWood), wo, significance);
}

TEST_F(PlasticTest, SmoothValueDensityAndWeightAgree) {
    for (const PlasticLobe& lobe : {smooth(kWood), smooth(kWood, true, 1.9)}) {
        for (Vec3 wo : test_directions_both_sides()) {
            expect_sample_agrees_with_eval(lobe, wo);
            expect_adjoint_symmetry(lobe, wo);
            expect_delta_events_reverse(lobe, wo);
        }
        expect_finite(lobe);
    }
}

// F + (1 − F) (1 − F_ext) ρ / (η² (1 − F_int)) = 1 for ρ = 1, because 1 − F_ext = η² (1 − F_int).
TEST_F(PlasticTest, WhiteSmoothPlasticLosesNothing) {
    for (const double ior : {1.1, 1.5, 2.5, 1000.0})
        for (const bool nonlinear : {false, true})
            for (Vec3 wo : test_directions()) {
                const Albedo a = sampled_albedo(smooth(Rgb(1), nonlinear, ior), wo);
                EXPECT_NEAR(a.value.g, 1, 5 * a.standard_error.g + 1e-4) << ior;
            }
}

TEST_F(PlasticTest, IndicesMayBeEqualOrLarge) {
    TestMaterials m;
    for (const double ior : {1.0, 1.0001, 30.0, 1e4, 1e6})
        for (const bool nonlinear : {false, true})
            for (const double thickness : {0.0, 0.1}) {
                SCOPED_TRACE(fmt::format("{} {} {}", ior, nonlinear, thickness));
                const auto made = [&](const char* type) -> const Material& {
                    return m.make(type, {{"int_ior", ior},
                                         {"ext_ior", 1.0},
                                         {"nonlinear", nonlinear},
                                         {"thickness", thickness}});
                };
                const auto smooth = lobe_of<PlasticLobe>(made("plastic"));
                const auto rough = lobe_of<RoughPlasticLobe>(made("roughplastic"));
                expect_finite(smooth);
                expect_finite(rough);
                if (ior > 1) continue;
                EXPECT_EQ(smooth.diffuse, Rgb(0.5f));
                EXPECT_EQ(rough.diffuse, Rgb(0.5f));
            }
}

TEST_F(PlasticTest, NonlinearInterreflectionDarkensColoursButNotWhite) {
    const PlasticLobe linear = smooth(kWood), nonlinear = smooth(kWood, true);
    for (int c = 0; c < 3; ++c) EXPECT_LT(nonlinear.diffuse[c], 0.9f * linear.diffuse[c]);
    EXPECT_FLOAT_EQ(smooth(Rgb(1), true).diffuse.g, smooth(Rgb(1)).diffuse.g);
}

TEST_F(PlasticTest, RoughSamplesMatchPdf) {
    const auto directions = test_directions();
    const double significance = sidak(1e-3, int(2 * 4 * directions.size()));
    for (const char* distribution : {"beckmann", "ggx"})
        for (const double alpha : {0.05, 0.3}) {
            SCOPED_TRACE(alpha);
            const RoughPlasticLobe lobe = rough(distribution, alpha, Rgb(0.1f));
            for (Vec3 wo : directions) expect_samples_match_pdf(lobe, wo, significance, 30000);
        }
}

TEST_F(PlasticTest, RoughValueDensityAndWeightAgree) {
    for (const char* distribution : {"beckmann", "ggx"})
        for (const double alpha : {0.01, 0.1, 0.5}) {
            SCOPED_TRACE(alpha);
            const RoughPlasticLobe lobe = rough(distribution, alpha, kWood, true);
            for (Vec3 wo : test_directions_both_sides()) {
                expect_sample_agrees_with_eval(lobe, wo);
                expect_adjoint_symmetry(lobe, wo);
            }
            expect_finite(lobe);
        }
}

TEST_F(PlasticTest, RoughConservesEnergyAndLosesLittleWhenSharp) {
    for (const char* distribution : {"beckmann", "ggx"})
        for (const double alpha : {0.02, 0.1, 0.5}) {
            SCOPED_TRACE(alpha);
            const RoughPlasticLobe lobe = rough(distribution, alpha, Rgb(1));
            for (Vec3 wo : test_directions()) expect_energy_conserved(lobe, wo);
            if (alpha < 0.05) {
                EXPECT_GT(sampled_albedo(lobe, {0, 0, 1}).value.g, 0.95f);
            }
        }
}

// The tables hold the single-scattering albedos of the rough dielectric.
TEST_F(PlasticTest, RoughTransmittanceIsThatOfTheRoughDielectric) {
    for (const auto kind : {Microfacet::Kind::Beckmann, Microfacet::Kind::Ggx})
        for (const float alpha : {0.001f, 0.1f, 0.6f}) {
            const Microfacet distribution(kind, alpha, alpha);
            const RoughTransmittance rough(distribution, 1.5f);
            const RoughDielectricLobe transmits{distribution, 1.5f, Rgb(0), Rgb(1)};
            for (const double theta : {0.0, 40.0, 65.0}) {
                const Vec3 wo = direction(theta, 0);
                const Albedo T = sampled_albedo(transmits, wo);
                EXPECT_NEAR(RoughTransmittance::lookup(rough.table(), wo.z), T.value.g,
                            4 * T.standard_error.g + 3e-3)
                    << alpha << " " << theta;
            }
            const RoughDielectricLobe reflects{distribution, 1.5f, Rgb(1), Rgb(0)};
            LobeRandom random(8);
            double internal = 0;
            constexpr int n = 50000;  // standard error at most 0.0023
            for (int i = 0; i < n; ++i) {
                const Vec3 wo = -sample_cosine_hemisphere(random.next_2d());
                const float u_lobe = random.next();
                if (const auto s =
                        reflects.sample(wo, lobe_choice(reflects, u_lobe), random.next_2d()))
                    internal += double(s->weight.g) / n;
            }
            // Equal weights of 64 nodes are about 1 % low.
            EXPECT_NEAR(rough.internal_reflectance(), internal, 0.014) << alpha;
        }
}

TEST_F(PlasticTest, ParametersAreChecked) {
    TestMaterials m;
    EXPECT_THROW(m.make("plastic", {{"int_ior", std::string("plastique")}}), SceneError);
    EXPECT_THROW(m.make("roughplastic", {{"distribution", std::string("gauss")}}), SceneError);
    EXPECT_THROW(m.make("roughplastic", {{"alpha", -0.1}}), SceneError);
    EXPECT_FLOAT_EQ(lobe_of<PlasticLobe>(m.make("plastic")).eta, 1.49f / 1.000277f);
}

TEST(SharedTransmittances, AreThoseOfTheCoatAndMadeOnce) {
    const auto a = SharedTransmittance::of(Microfacet::Kind::Ggx, 0.3f, 1.5f),
               b = SharedTransmittance::of(Microfacet::Kind::Ggx, 0.3f, 1.5f);
    EXPECT_EQ(a, b);
    EXPECT_NE(a, SharedTransmittance::of(Microfacet::Kind::Beckmann, 0.3f, 1.5f));
    EXPECT_NE(a, SharedTransmittance::of(Microfacet::Kind::Ggx, 0.3f, 1.6f));
    const float* tables[4];
    std::vector<std::thread> threads;
    for (const float*& table : tables)
        threads.emplace_back([&table, &a] { table = a->get().table(); });
    for (std::thread& t : threads) t.join();
    for (const float* table : tables) EXPECT_EQ(table, tables[0]);
    const RoughTransmittance expected({Microfacet::Kind::Ggx, 0.3f, 0.3f}, 1.5f);
    EXPECT_EQ(a->get().internal_reflectance(), expected.internal_reflectance());
    for (int i = 0; i < 64; ++i) EXPECT_EQ(tables[0][i], expected.table()[i]);
}

}  // namespace
}  // namespace etendue
