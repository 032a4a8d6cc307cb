// Oren and Nayar's rough diffuse reflection. False-alarm rate of the χ² tests: 0.1 %.

#include "bsdf/orennayar.h"

#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

/// A and B at σ = 20°.
constexpr float kA = 0.8651f, kB = 0.2589f;
OrenNayarLobe clay() {
    return {Rgb(0.2f, 0.5f, 0.8f), kA, kB};
}

TEST(OrenNayar, SamplesMatchPdf) {
    const double significance = sidak(1e-3, int(2 * test_directions().size()));
    for (Vec3 wo : test_directions()) expect_samples_match_pdf(clay(), wo, significance, 30000);
}

TEST(OrenNayar, ValueDensityAndWeightAgree) {
    for (Vec3 wo : test_directions_both_sides()) {
        expect_sample_agrees_with_eval(clay(), wo);
        expect_adjoint_symmetry(clay(), wo);
        expect_energy_conserved(clay(), wo);
    }
    expect_finite(clay());
}

TEST(OrenNayar, IsThePublishedFormula) {
    const double to = 0.7, ti = 0.4, dphi = 0.6;
    const Vec3 wo = direction(to * 180 / M_PI, 20),
               wi = direction(ti * 180 / M_PI, 20 + dphi * 180 / M_PI);
    const double f = 0.5 / M_PI * (kA + kB * std::cos(dphi) * std::sin(to) * std::tan(ti));
    EXPECT_NEAR(clay().eval(wo, wi).f.g, f * std::cos(ti), 1e-6);
    // Facets that face away from the light add nothing.
    const Vec3 behind = direction(ti * 180 / M_PI, 200);
    EXPECT_NEAR(clay().eval(wo, behind).f.g, 0.5 / M_PI * kA * std::cos(ti), 1e-6);
}

TEST(OrenNayar, MaterialTurnsSigmaIntoTheFactors) {
    TestMaterials m;
    ComponentArena arena;
    const Bsdf bsdf = m.make("orennayar", {{"sigma", 20.0}}).bsdf(plane_point({0, 0, 1}), arena);
    const auto& made = std::get<OrenNayarLobe>(bsdf.front().lobe);
    EXPECT_NEAR(made.A, kA, 1e-4);
    EXPECT_NEAR(made.B, kB, 1e-4);
    EXPECT_THROW(m.make("orennayar", {{"sigma", 120.0}}), SceneError);
}

}  // namespace
}  // namespace etendue
