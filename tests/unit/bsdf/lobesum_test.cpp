// Sums of lobes with factors of their own.

#include "bsdf/bsdf.h"
#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

/// Mean of sample()'s weights.
double albedo_of(const Bsdf& bsdf, Vec3 wo) {
    LobeRandom random(1);
    constexpr int kSamples = 200000;
    double sum = 0;
    for (int i = 0; i < kSamples; ++i) {
        const float u_lobe = random.next();
        if (const auto s = bsdf.sample(wo, u_lobe, random.next_2d(), TransportMode::Importance))
            sum += s->weight.g;
    }
    return sum / kSamples;
}

TEST(LobeSum, EveryLobeCountsInFull) {
    TestMaterials m;
    ComponentArena arena;
    const Vec3 wo = direction(30, 0);
    const Bsdf bsdf = m.make("lobesum", {{"diffuse_reflectance", 0.2},
                                         {"diffuse_transmittance", 0.1},
                                         {"glossy_reflectance", 0.0},
                                         {"specular_reflectance", 0.5},
                                         {"specular_transmittance", 0.3},
                                         {"eta", 1.5}})
                          .bsdf(plane_point(wo), arena);
    const double F = fresnel_dielectric(wo.z, 1.5f).R;
    EXPECT_NEAR(albedo_of(bsdf, wo), 0.3 + 0.5 * F + 0.3 * (1 - F), 3e-3);
}

TEST(LobeSum, DiffuseAndGlossyAddUp) {
    TestMaterials m;
    ComponentArena arena;
    const Vec3 wo = direction(30, 0), wi = direction(20, 170);
    const Bsdf bsdf = m.make("lobesum", {{"diffuse_reflectance", 0.2},
                                         {"glossy_reflectance", 0.5},
                                         {"distribution", std::string("ggx")},
                                         {"alpha", 0.3},
                                         {"eta", 1.5}})
                          .bsdf(plane_point(wo), arena);
    const Microfacet facets(Microfacet::Kind::Ggx, 0.3f, 0.3f);
    const Rgb expected = DiffuseLobe{Rgb(0.2f)}.eval(wo, wi).f +
                         RoughConductorLobe{facets, Rgb(1.5f), Rgb(0), Rgb(0.5f)}.eval(wo, wi).f;
    EXPECT_TRUE(nearly(bsdf.eval(wo, wi, TransportMode::Importance).f, expected, 1e-5, 0));
    // A metal without absorption has a dielectric's Fresnel term.
    EXPECT_NEAR(fresnel_conductor(0.6f, Rgb(1.5f), Rgb(0)).g, fresnel_dielectric(0.6f, 1.5f).R,
                1e-6);
    EXPECT_NEAR(fresnel_conductor(0.3f, Rgb(1 / 1.5f), Rgb(0)).g, 1, 1e-6);
}

TEST(LobeSum, ReflectsTheSameFromBehind) {
    TestMaterials m;
    ComponentArena arena;
    const Vec3 wo = direction(30, 0), wi = direction(20, 170);
    const auto at = [&](Vec3 from, Vec3 to) {
        const Bsdf bsdf =
            m.make("lobesum", {{"diffuse_reflectance", 0.2}}).bsdf(plane_point(from), arena);
        return bsdf.eval(from, to, TransportMode::Radiance).f;
    };
    EXPECT_TRUE(nearly(at(wo, wi), at({wo.x, wo.y, -wo.z}, {wi.x, wi.y, -wi.z}), 1e-5, 0));
    EXPECT_TRUE(at(wo, {wi.x, wi.y, -wi.z}).is_zero());
}

TEST(LobeSum, DiffuseLightGoesToItsSide) {
    TestMaterials m;
    ComponentArena arena;
    const Vec3 wo = direction(30, 0), wi = direction(20, 170), below{wi.x, wi.y, -wi.z};
    const Bsdf bsdf = m.make("lobesum", {{"diffuse_reflectance", 0.2},
                                         {"diffuse_transmittance", 0.1},
                                         {"glossy_reflectance", 0.0}})
                          .bsdf(plane_point(wo), arena);
    EXPECT_NEAR(bsdf.eval(wo, wi, TransportMode::Importance).f.g, 0.2f * wi.z * kInvPi, 1e-6);
    EXPECT_NEAR(bsdf.eval(wo, below, TransportMode::Importance).f.g, 0.1f * wi.z * kInvPi, 1e-6);
}

TEST(LobeSum, WithoutLobesNothingOfAnotherSurfaceIsLeft) {
    TestMaterials m;
    ComponentArena arena;
    Bsdf bsdf;
    const Vec3 wo = direction(30, 0), tilted = direction(20, 50);
    m.make("roughconductor", {{"alpha", 0.3}}).make_bsdf(plane_point(wo), arena, bsdf);
    ASSERT_FLOAT_EQ(bsdf.roughness(), 0.3f);
    SurfacePoint point = plane_point(wo);
    point.ns = tilted;
    m.make("lobesum", {{"diffuse_reflectance", 0.0}, {"glossy_reflectance", 0.0}})
        .make_bsdf(point, arena, bsdf);
    EXPECT_NEAR(length(bsdf.shading_normal() - tilted), 0, 1e-6);
    EXPECT_EQ(bsdf.roughness(), 0);
    EXPECT_TRUE(bsdf.albedo_estimate().is_zero());
    EXPECT_FALSE(bsdf.has_smooth() || bsdf.has_delta());
    EXPECT_TRUE(bsdf.eval(wo, direction(10, 0), TransportMode::Radiance).f.is_zero());
    EXPECT_EQ(bsdf.max_pdf(wo, {{0, 0, 1}, kPi}), 0);
    for (const float u : {0.0f, 0.5f, kOneMinusEpsilon})
        EXPECT_FALSE(bsdf.sample(wo, u, {0.3f, 0.6f}, TransportMode::Radiance));
}

TEST(LobeSum, WithoutContrastThereIsNoGloss) {
    TestMaterials m;
    ComponentArena arena;
    const Bsdf bsdf = m.make("lobesum", {{"diffuse_reflectance", 0.4}, {"eta", 1.0}})
                          .bsdf(plane_point({0, 0, 1}), arena);
    EXPECT_TRUE(bsdf.diffuse_normal());
}

}  // namespace
}  // namespace etendue
