// Diffuse reflection and transmission. False-alarm rate of the χ² tests: 0.1 %.

#include "bsdf/diffusetransmission.h"

#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

DiffuseTransmissionLobe paper() {
    return {Rgb(0.2f, 0.3f, 0.4f), Rgb(0.1f, 0.5f, 0.6f)};
}

TEST(DiffuseTransmission, SamplesMatchPdf) {
    const auto directions = test_directions_both_sides();
    const double significance = sidak(1e-3, int(2 * directions.size()));
    for (Vec3 wo : directions) expect_samples_match_pdf(paper(), wo, significance, 30000);
}

TEST(DiffuseTransmission, ValueDensityAndWeightAgree) {
    for (Vec3 wo : test_directions_both_sides()) {
        expect_sample_agrees_with_eval(paper(), wo);
        expect_adjoint_symmetry(paper(), wo);
        expect_energy_conserved(paper(), wo);
    }
    expect_finite(paper());
}

TEST(DiffuseTransmission, AlbedoIsTheSumOfBoth) {
    for (Vec3 wo : test_directions_both_sides())
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(integrated_albedo(paper(), wo, c),
                        paper().reflectance[c] + paper().transmittance[c], 1e-3);
}

TEST(DiffuseTransmission, MaterialRefusesMoreLightThanThereIs) {
    TestMaterials m;
    EXPECT_TRUE(m.make("diffusetransmission").is_transmissive());
    EXPECT_THROW(m.make("diffusetransmission", {{"reflectance", 0.6}, {"transmittance", 0.6}}),
                 SceneError);
}

}  // namespace
}  // namespace etendue
