// Ideal diffuse reflection. False-alarm rate of the χ² tests: 0.1 %.

#include "bsdf/diffuse.h"

#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

TEST(Diffuse, SamplesMatchPdf) {
    const double significance = sidak(1e-3, int(2 * test_directions().size()));
    for (Vec3 wo : test_directions())
        expect_samples_match_pdf(DiffuseLobe{Rgb(0.2f, 0.5f, 0.8f)}, wo, significance);
}

TEST(Diffuse, ValueDensityAndWeightAgree) {
    const DiffuseLobe lobe{Rgb(0.2f, 0.5f, 0.8f)};
    for (Vec3 wo : test_directions_both_sides()) {
        expect_sample_agrees_with_eval(lobe, wo);
        expect_adjoint_symmetry(lobe, wo);
    }
    expect_finite(lobe);
}

TEST(Diffuse, AlbedoIsTheReflectance) {
    const Rgb reflectance(0.2f, 0.5f, 0.8f);
    for (Vec3 wo : test_directions())
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(integrated_albedo(DiffuseLobe{reflectance}, wo, c), reflectance[c], 1e-3);
}

TEST(Diffuse, IsBlackFromBehind) {
    const DiffuseLobe lobe{Rgb(1)};
    EXPECT_FALSE(lobe.sample(direction(120, 0), 0.5f, {0.5f, 0.5f}));
    EXPECT_TRUE(lobe.eval(direction(120, 0), direction(30, 0)).f.is_zero());
    EXPECT_TRUE(lobe.eval(direction(30, 0), direction(120, 0)).f.is_zero());
}

TEST(Diffuse, MaterialReadsItsReflectance) {
    TestMaterials m;
    EXPECT_EQ(m.make("diffuse").mean_albedo(), Rgb(0.5f));
    EXPECT_EQ(m.make("diffuse", {{"reflectance", Rgb(0.1f, 0.2f, 0.3f)}}).mean_albedo(),
              Rgb(0.1f, 0.2f, 0.3f));
    EXPECT_THROW(m.make("diffuse", {{"reflectance", 1.5}}), SceneError);
    EXPECT_THROW(m.make("diffuse", {{"reflectivity", 0.5}}), SceneError);
}

}  // namespace
}  // namespace etendue
