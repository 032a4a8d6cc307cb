// Parameters of conductors and dielectrics: defaults, names, and refused values.

#include <gtest/gtest.h>

#include "bsdf/ior.h"
#include "color/metals.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;
using Values = std::vector<TestMaterials::Value>;

/// The lobe of a material that has one.
template <class L>
L only_lobe(const char* type, const Values& values = {}) {
    TestMaterials materials;
    const Material& material = materials.make(type, values);
    ComponentArena arena;
    return std::get<L>(material.bsdf(plane_point({0, 0, 1}), arena).front().lobe);
}

/// Message of the SceneError that making the material raises.
std::string refusal(const char* type, const Values& values) {
    try {
        TestMaterials().make(type, values);
    } catch (const SceneError& e) {
        return e.message();
    }
    return "accepted";
}

TEST(MaterialMakers, ConductorsAreMirrorsByDefault) {
    TestMaterials materials;
    const Material& smooth = materials.make("conductor");
    EXPECT_FALSE(smooth.is_two_sided() || smooth.is_transmissive() || smooth.may_be_smooth());
    EXPECT_EQ(smooth.mean_albedo(), Rgb(1));
    const auto lobe = only_lobe<RoughConductorLobe>("roughconductor");
    EXPECT_EQ(lobe.eta, Rgb(0));
    EXPECT_EQ(lobe.k, Rgb(1));
    EXPECT_EQ(lobe.distribution.kind(), Microfacet::Kind::Beckmann);
    EXPECT_EQ(lobe.distribution.alpha_x(), 0.1f);
    EXPECT_EQ(lobe.distribution.alpha_y(), 0.1f);
}

TEST(MaterialMakers, ConductorsTakeNamesOrIndices) {
    const auto gold = only_lobe<ConductorLobe>("conductor", {{"material", std::string("Au")}});
    EXPECT_EQ(gold.eta, named_metal("Au")->eta);
    EXPECT_EQ(gold.k, named_metal("Au")->k);
    const auto given = only_lobe<ConductorLobe>(
        "conductor", {{"eta", Rgb(0.2f, 0.9f, 1.1f)}, {"k", 3.0}, {"specular_reflectance", 0.5}});
    EXPECT_EQ(given.eta, Rgb(0.2f, 0.9f, 1.1f));
    EXPECT_EQ(given.k, Rgb(3));
    EXPECT_EQ(given.reflectance, Rgb(0.5f));
    EXPECT_NE(refusal("conductor", {{"material", std::string("Unobtainium")}}).find("Unobtainium"),
              std::string::npos);
    EXPECT_NE(
        refusal("conductor", {{"material", std::string("Au")}, {"eta", 1.0}}).find("not both"),
        std::string::npos);
}

TEST(MaterialMakers, RoughnessIsIsotropicOrGivenTwice) {
    const auto lobe = only_lobe<RoughConductorLobe>(
        "roughconductor",
        {{"distribution", std::string("ggx")}, {"alpha_u", 0.2}, {"alpha_v", 0.4}});
    EXPECT_EQ(lobe.distribution.kind(), Microfacet::Kind::Ggx);
    EXPECT_EQ(lobe.distribution.alpha_x(), 0.2f);
    EXPECT_EQ(lobe.distribution.alpha_y(), 0.4f);
    EXPECT_NE(refusal("roughconductor", {{"alpha", 0.2}, {"alpha_u", 0.2}, {"alpha_v", 0.2}})
                  .find("not both"),
              std::string::npos);
    EXPECT_NE(refusal("roughdielectric", {{"alpha_u", 0.2}}).find("together"), std::string::npos);
    EXPECT_NE(
        refusal("roughconductor", {{"distribution", std::string("phong")}}).find("beckmann, ggx"),
        std::string::npos);
}

TEST(MaterialMakers, DielectricsAreGlassInAirByDefault) {
    constexpr float kGlassInAir = 1.5046f / 1.000277f;
    EXPECT_EQ(only_lobe<DielectricLobe>("dielectric").eta, kGlassInAir);
    EXPECT_EQ(only_lobe<ThinDielectricLobe>("thindielectric").eta, kGlassInAir);
    EXPECT_EQ(only_lobe<RoughDielectricLobe>("roughdielectric").eta, kGlassInAir);
    TestMaterials materials;
    for (const char* type : {"dielectric", "thindielectric", "roughdielectric"}) {
        const Material& m = materials.make(type);
        EXPECT_TRUE(m.is_transmissive() && m.is_two_sided());
        EXPECT_EQ(m.may_be_smooth(), std::string(type) == "roughdielectric");
        EXPECT_EQ(m.mean_albedo(), Rgb(1));
    }
}

TEST(MaterialMakers, IndicesAreNumbersOrNames) {
    const auto lobe =
        only_lobe<DielectricLobe>("dielectric", {{"int_ior", std::string("diamond")},
                                                 {"ext_ior", 1.333},
                                                 {"specular_transmittance", Rgb(1, 0, 0)}});
    EXPECT_EQ(lobe.eta, 2.419f / 1.333f);
    EXPECT_EQ(lobe.transmittance, Rgb(1, 0, 0));
    EXPECT_EQ(lobe.reflectance, Rgb(1));
    EXPECT_NE(refusal("dielectric", {{"int_ior", std::string("treacle")}}).find("treacle"),
              std::string::npos);
    EXPECT_NE(refusal("dielectric", {{"int_ior", 0.0}}).find("above 0"), std::string::npos);
    EXPECT_NE(refusal("dielectric", {{"int_ior", true}}).find("must be a number or"),
              std::string::npos);
    EXPECT_NE(refusal("roughdielectric", {{"int_ior", 1.5}, {"ext_ior", 1.5}}).find("different"),
              std::string::npos);
}

}  // namespace
}  // namespace etendue
