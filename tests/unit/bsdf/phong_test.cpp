// The modified Phong model. False-alarm rate of the χ² tests: 0.1 %.

#include "bsdf/phong.h"

#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

constexpr float kExponents[] = {0, 5, 300};
constexpr float kSharpExponents[] = {1e5f, 1e7f, 1e8f};

PhongLobe phong(float exponent) {
    return {Rgb(0.3f, 0.2f, 0.1f), Rgb(0.5f, 0.6f, 0.7f), exponent, 0.7f};
}

TEST(Phong, SamplesMatchPdf) {
    const double significance =
        sidak(1e-3, int(2 * std::size(kExponents) * test_directions().size()));
    for (const float n : kExponents)
        for (Vec3 wo : test_directions()) {
            SCOPED_TRACE(n);
            expect_samples_match_pdf(phong(n), wo, significance, 30000);
        }
}

TEST(Phong, ValueDensityAndWeightAgree) {
    for (const float n : kExponents) {
        SCOPED_TRACE(n);
        for (Vec3 wo : test_directions_both_sides()) {
            expect_sample_agrees_with_eval(phong(n), wo);
            expect_adjoint_symmetry(phong(n), wo);
            expect_energy_conserved(phong(n), wo);
        }
        expect_finite(phong(n));
    }
}

// Products of unit vectors in float, whose error is near 1e-7, have not enough digits for cosⁿ α.
TEST(Phong, SharpLobesAreThoseOfTheirExponent) {
    for (const float n : kSharpExponents) {
        SCOPED_TRACE(n);
        const PhongLobe lobe = phong(n);
        expect_finite(lobe);
        for (Vec3 wo : test_directions()) {
            const Vec3 mirror = reflect(wo);
            const Frame frame = Frame::from_normal(mirror);
            for (const double share : {0.0, 0.5, 1.0, 1.5}) {
                const double angle = share / std::sqrt(double(n));
                const Vec3 wi = normalize(mirror + frame.s * float(std::tan(angle)));
                const double expected = 0.7 * (double(n) + 1) / (2 * M_PI) *
                                        std::exp(double(n) * std::log(std::cos(angle)));
                EXPECT_NEAR(double(lobe.eval(wo, wi).pdf) / expected, 1, 0.01) << share;
            }
            EXPECT_NEAR(sampled_albedo(lobe, wo).value.g, 0.2 + 0.6 * double(wo.z), 0.02);
        }
    }
}

TEST(Phong, AlbedoAtNormalIncidenceIsTheSumOfTheColours) {
    for (const float n : kExponents) {
        const PhongLobe lobe = phong(n);
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(integrated_albedo(lobe, {0, 0, 1}, c), lobe.diffuse[c] + lobe.specular[c],
                        1e-3)
                << n;
    }
}

TEST(Phong, ColoursAreScaledDownToConserveEnergy) {
    TestMaterials m;
    const Material& bright =
        m.make("phong", {{"diffuse_reflectance", 0.9}, {"specular_reflectance", 0.6}});
    ComponentArena arena;
    const Bsdf bsdf = bright.bsdf(plane_point({0, 0, 1}), arena);
    EXPECT_TRUE(nearly(bsdf.albedo_estimate(), Rgb(1), 1e-6, 0));
    EXPECT_THROW(m.make("phong", {{"exponent", -1.0}}), SceneError);
    EXPECT_THROW(m.make("phong", {{"exponent", 2e8}}), SceneError);
}

}  // namespace
}  // namespace etendue
