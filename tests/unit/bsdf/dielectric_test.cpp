// Smooth, thin and rough dielectrics. False-alarm rate of the χ² tests of each TEST: 0.1 %.

#include "bsdf/dielectric.h"

#include "bsdf/roughdielectric.h"
#include "bsdf/thindielectric.h"
#include "lobe_tests.h"
#include "roughness.h"

namespace etendue {
namespace {

using namespace etendue::testing;
using Kind = Microfacet::Kind;

constexpr float kEta[] = {1.5f, 1 / 1.5f, 1.1f, 2.4f};

RoughDielectricLobe rough_glass(Kind kind, Roughness a, float eta, Rgb reflectance = Rgb(1),
                                Rgb transmittance = Rgb(1)) {
    return {Microfacet(kind, a.x, a.y), eta, reflectance, transmittance};
}

TEST(Dielectric, RefractsOrReflectsWithProbabilityF) {
    const DielectricLobe lobe{1.5f, Rgb(0.5f, 1, 1), Rgb(1, 0.5f, 1)};
    for (Vec3 wo : test_directions_both_sides()) {
        const float F = fresnel_dielectric(wo.z, 1.5f).R;
        const auto r = lobe.sample(wo, 0.99f * F, {});
        ASSERT_TRUE(r && r->is_delta);
        EXPECT_EQ(r->wi, reflect(wo));
        EXPECT_EQ(r->weight, lobe.reflectance);
        EXPECT_EQ(r->pdf, F);
        EXPECT_EQ(r->eta, 1);
        if (F == 1) continue;
        const auto t = lobe.sample(wo, F + 0.5f * (1 - F), {});
        ASSERT_TRUE(t && t->is_delta);
        EXPECT_EQ(t->weight, lobe.transmittance);
        EXPECT_EQ(t->pdf, 1 - F);
        EXPECT_FLOAT_EQ(t->eta, wo.z > 0 ? 1.5f : 1 / 1.5f);
        // Snell: η sin θ is the same on both sides, and wi goes on where wo came from.
        EXPECT_NEAR(t->wi.x * t->eta, -wo.x, 1e-6);
        EXPECT_NEAR(t->wi.y * t->eta, -wo.y, 1e-6);
        EXPECT_LT(t->wi.z * wo.z, 0);
    }
}

TEST(Dielectric, IsLosslessAndReversible) {
    for (float eta : kEta)
        for (Vec3 wo : test_directions_both_sides()) {
            const DielectricLobe lobe{eta, Rgb(1), Rgb(1)};
            EXPECT_EQ(sampled_albedo(lobe, wo, 16).value, Rgb(1));
            expect_delta_events_reverse(lobe, wo);
            expect_sample_agrees_with_eval(lobe, wo);
        }
    expect_finite(DielectricLobe{1.5f, Rgb(1), Rgb(1)});
    expect_finite(DielectricLobe{1, Rgb(1), Rgb(1)});
}

TEST(ThinDielectric, SumsInternalReflections) {
    const ThinDielectricLobe lobe{1.5f, Rgb(1, 0.5f, 1), Rgb(1)};
    for (Vec3 wo : test_directions_both_sides()) {
        const double R = fresnel_dielectric(std::fabs(wo.z), 1.5f).R;
        double sum = R, bounce = (1 - R) * (1 - R) * R;
        for (int i = 0; i < 200; ++i, bounce *= R * R) sum += bounce;
        const auto r = lobe.sample(wo, 0, {}), t = lobe.sample(wo, kOneMinusEpsilon, {});
        ASSERT_TRUE(r && t);
        EXPECT_NEAR(r->pdf, sum, 1e-5);
        EXPECT_EQ(r->wi, reflect(wo));
        EXPECT_EQ(r->weight, lobe.reflectance);
        EXPECT_NEAR(t->pdf, 1 - sum, 1e-5);
        EXPECT_EQ(t->wi, -wo);
        EXPECT_EQ(t->eta, 1);
        expect_delta_events_reverse(lobe, wo);
    }
    expect_finite(lobe);
}

class RoughDielectricOf : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(Both, RoughDielectricOf, ::testing::Values(Kind::Beckmann, Kind::Ggx),
                         [](const auto& kind) {
                             return kind.param == Kind::Ggx ? "Ggx" : "Beckmann";
                         });

TEST_P(RoughDielectricOf, SamplesMatchPdf) {
    const auto directions = test_directions_both_sides();
    const double significance =
        sidak(1e-3, int(2 * (std::size(kRoughness) + 2) * directions.size()));
    for (Vec3 wo : directions) {
        for (const Roughness a : kRoughness) {
            SCOPED_TRACE(a.x);
            expect_samples_match_pdf(rough_glass(GetParam(), a, 1.5f), wo, significance, 30000);
        }
        for (const float eta : {1 / 1.3f, 2.4f}) {
            SCOPED_TRACE(eta);
            expect_samples_match_pdf(rough_glass(GetParam(), {0.3f, 0.3f}, eta), wo, significance,
                                     30000);
        }
    }
}

TEST_P(RoughDielectricOf, ValueDensityAndWeightAgree) {
    for (const Roughness a : kRoughness)
        for (float eta : kEta)
            for (Vec3 wo : test_directions_both_sides()) {
                SCOPED_TRACE(a.x);
                SCOPED_TRACE(eta);
                const RoughDielectricLobe lobe =
                    rough_glass(GetParam(), a, eta, Rgb(0.5f, 1, 0), Rgb(1, 0.5f, 1));
                // One rounding of wi moves the facet by 1e-7 / |η − 1|, which is to be held against
                // α.
                expect_sample_agrees_with_eval(lobe, wo, a.x < 0.01f ? 1e-1 : 3e-3, 500);
                expect_adjoint_symmetry(lobe, wo, a.x < 0.01f ? 1e-1 : 3e-3, 500);
            }
}

TEST_P(RoughDielectricOf, AlbedoAgreesWithQuadratureAndLosesOnlyMultipleScattering) {
    for (const Roughness a : kRoughness)
        for (Vec3 wo : test_directions_both_sides()) {
            SCOPED_TRACE(a.x);
            // Red sees all, green the reflection alone.
            const RoughDielectricLobe lobe =
                rough_glass(GetParam(), a, 1.5f, Rgb(1, 1, 0), Rgb(1, 0, 1));
            expect_energy_conserved(lobe, wo);
            const Albedo sampled = sampled_albedo(lobe, wo);
            for (int c : {0, 1})
                EXPECT_NEAR(sampled.value[c], integrated_albedo(lobe, wo, c),
                            4 * sampled.standard_error[c] + 1e-3f)
                    << describe(wo) << " channel " << c;
            if (a.x <= 0.05f && std::fabs(wo.z) > 0.4f) {
                EXPECT_GT(sampled.value.r, 0.99f) << describe(wo);
            }
        }
}

TEST_P(RoughDielectricOf, IsFinite) {
    for (float eta : kEta) {
        for (const Roughness a : kRoughness) expect_finite(rough_glass(GetParam(), a, eta));
        expect_finite(rough_glass(GetParam(), {0, 0}, eta));
        expect_finite(rough_glass(GetParam(), {100, 100}, eta));
    }
}

TEST_P(RoughDielectricOf, SharpLobeTendsToTheSmoothDielectric) {
    const RoughDielectricLobe lobe =
        rough_glass(GetParam(), {1e-4f, 1e-4f}, 1.5f, Rgb(1, 0, 0), Rgb(0, 1, 0));
    for (Vec3 wo : {direction(0, 0), direction(30, 0), direction(35, 130), direction(150, 40)}) {
        const float F = fresnel_dielectric(wo.z, 1.5f).R;
        const Albedo a = sampled_albedo(lobe, wo, 64);
        EXPECT_NEAR(a.value.r, F, 5 * a.standard_error.r + 1e-3f) << describe(wo);
        EXPECT_NEAR(a.value.g, 1 - F, 5 * a.standard_error.g + 1e-3f) << describe(wo);
        const auto t = lobe.sample(wo, kOneMinusEpsilon, {0.5f, 0.5f});
        ASSERT_TRUE(t);
        EXPECT_LT(length(t->wi - refract(wo, fresnel_dielectric(wo.z, 1.5f))), 1e-3);
    }
}

}  // namespace
}  // namespace etendue
