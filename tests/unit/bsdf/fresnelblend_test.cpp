// Ashikhmin and Shirley's coat over a diffuse base. False-alarm rate of the χ² tests: 0.1 %.

#include "bsdf/fresnelblend.h"

#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

constexpr float kAlphas[] = {0.02f, 0.1f, 0.5f};

FresnelBlendLobe blend(float alpha) {
    return {Rgb(0.2f, 0.5f, 0.7f),
            Rgb(0.05f, 0.1f, 0.3f),
            {Microfacet::Kind::Ggx, alpha, 1.5f * alpha}};
}

TEST(FresnelBlend, SamplesMatchPdf) {
    const double significance = sidak(1e-3, int(2 * std::size(kAlphas) * test_directions().size()));
    for (const float alpha : kAlphas)
        for (Vec3 wo : test_directions()) {
            SCOPED_TRACE(alpha);
            expect_samples_match_pdf(blend(alpha), wo, significance, 30000);
        }
}

TEST(FresnelBlend, ValueDensityAndWeightAgree) {
    for (const float alpha : kAlphas) {
        SCOPED_TRACE(alpha);
        for (Vec3 wo : test_directions_both_sides()) {
            expect_sample_agrees_with_eval(blend(alpha), wo, 3e-3);
            expect_adjoint_symmetry(blend(alpha), wo, 3e-3);
            expect_energy_conserved(blend(alpha), wo);
        }
        expect_finite(blend(alpha));
    }
}

TEST(FresnelBlend, WithoutACoatTheBaseIsThePublishedOne) {
    const FresnelBlendLobe base{Rgb(1), Rgb(0), {Microfacet::Kind::Ggx, 0.1f, 0.1f}};
    // Far from the mirror direction the coat adds next to nothing.
    const Vec3 wo = direction(40, 0), wi = direction(40, 0);
    const double c = std::cos(40 * M_PI / 180);
    const double side = 1 - std::pow(1 - c / 2, 5);
    EXPECT_NEAR(base.eval(wo, wi).f.g, 28 / (23 * M_PI) * side * side * c, 2e-3);
}

TEST(FresnelBlend, MaterialReadsItsParameters) {
    TestMaterials m;
    EXPECT_EQ(m.make("fresnelblend", {{"diffuse_reflectance", 0.5}, {"specular_reflectance", 0.5}})
                  .mean_albedo(),
              Rgb(0.75f));
    EXPECT_THROW(m.make("fresnelblend", {{"specular_reflectance", 1.5}}), SceneError);
}

}  // namespace
}  // namespace etendue
