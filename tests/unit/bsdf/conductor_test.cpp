// Smooth and rough metal. False-alarm rate of the χ² tests of each TEST: 0.1 %.

#include "bsdf/conductor.h"

#include "bsdf/roughconductor.h"
#include "lobe_tests.h"
#include "roughness.h"

namespace etendue {
namespace {

using namespace etendue::testing;
using Kind = Microfacet::Kind;

const Rgb kGoldEta{0.143f, 0.375f, 1.44f}, kGoldK{3.98f, 2.39f, 1.60f};

RoughConductorLobe mirror(Kind kind, Roughness a) {
    return {Microfacet(kind, a.x, a.y), Rgb(0), Rgb(1), Rgb(1)};
}
RoughConductorLobe gold(Kind kind, Roughness a) {
    return {Microfacet(kind, a.x, a.y), kGoldEta, kGoldK, Rgb(1, 0.9f, 0.8f)};
}

TEST(Conductor, ReflectsAsAMirrorWithFresnelsReflectance) {
    const ConductorLobe lobe{kGoldEta, kGoldK, Rgb(0.5f, 1, 1)};
    for (Vec3 wo : test_directions()) {
        const auto s = lobe.sample(wo, lobe_choice(lobe, 0.3f), {0.1f, 0.2f});
        ASSERT_TRUE(s);
        EXPECT_TRUE(s->is_delta);
        EXPECT_EQ(s->wi, reflect(wo));
        EXPECT_EQ(s->weight, Rgb(0.5f, 1, 1) * fresnel_conductor(wo.z, kGoldEta, kGoldK));
        EXPECT_EQ(s->pdf, 1);
        expect_delta_events_reverse(lobe, wo);
        EXPECT_TRUE(lobe.eval(wo, reflect(wo)).f.is_zero());
        EXPECT_FALSE(lobe.sample(-wo, 0.3f, {0.1f, 0.2f}));
    }
    expect_finite(lobe);
}

TEST(Conductor, PerfectMirrorLosesNothing) {
    for (Vec3 wo : test_directions())
        EXPECT_EQ(sampled_albedo(ConductorLobe{Rgb(0), Rgb(1), Rgb(1)}, wo, 8).value, Rgb(1));
}

class RoughConductorOf : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(Both, RoughConductorOf, ::testing::Values(Kind::Beckmann, Kind::Ggx),
                         [](const auto& kind) {
                             return kind.param == Kind::Ggx ? "Ggx" : "Beckmann";
                         });

TEST_P(RoughConductorOf, SamplesMatchPdf) {
    const auto directions = test_directions();
    const double significance = sidak(1e-3, int(2 * std::size(kRoughness) * directions.size()));
    for (const Roughness a : kRoughness)
        for (Vec3 wo : directions) {
            SCOPED_TRACE(a.x);
            expect_samples_match_pdf(gold(GetParam(), a), wo, significance);
        }
}

TEST_P(RoughConductorOf, ValueDensityAndWeightAgree) {
    for (const Roughness a : kRoughness)
        for (Vec3 wo : test_directions()) {
            SCOPED_TRACE(a.x);
            // One rounding of wi moves the half vector of a sharp lobe by up to 1e-7 of α = 0.001.
            const double relative = a.x < 0.01f ? 2e-2 : 1e-3;
            expect_sample_agrees_with_eval(gold(GetParam(), a), wo, relative);
            expect_adjoint_symmetry(gold(GetParam(), a), wo);
        }
}

TEST_P(RoughConductorOf, AlbedoAgreesWithQuadratureAndLosesOnlyMultipleScattering) {
    for (const Roughness a : kRoughness)
        for (Vec3 wo : test_directions()) {
            SCOPED_TRACE(a.x);
            const RoughConductorLobe lobe = gold(GetParam(), a);
            expect_energy_conserved(lobe, wo);
            const Albedo sampled = sampled_albedo(lobe, wo);
            EXPECT_NEAR(sampled.value.g, integrated_albedo(lobe, wo, 1),
                        4 * sampled.standard_error.g + 1e-3f)
                << describe(wo);
            expect_energy_conserved(mirror(GetParam(), a), wo);
            if (a.x <= 0.05f && wo.z > 0.4f) {
                EXPECT_GT(sampled_albedo(mirror(GetParam(), a), wo).value.g, 0.99f) << describe(wo);
            }
        }
}

TEST_P(RoughConductorOf, IsFinite) {
    for (const Roughness a : kRoughness) expect_finite(gold(GetParam(), a));
    expect_finite(gold(GetParam(), {0, 0}));
    expect_finite(gold(GetParam(), {100, 100}));
}

TEST_P(RoughConductorOf, SharpLobeTendsToTheMirror) {
    const RoughConductorLobe lobe = gold(GetParam(), {1e-4f, 1e-4f});
    const ConductorLobe limit{kGoldEta, kGoldK, lobe.reflectance};
    for (Vec3 wo : {direction(0, 0), direction(45, 0), direction(60, 130)}) {
        const Rgb expected = limit.sample(wo, 0, {})->weight;
        EXPECT_TRUE(nearly(sampled_albedo(lobe, wo, 32).value, expected, 1e-3, 0)) << describe(wo);
    }
}

}  // namespace
}  // namespace etendue
