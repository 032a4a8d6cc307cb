// Parameters of conductors and dielectrics: defaults, names, and refused values.

#include <gtest/gtest.h>

#include "bsdf/ior.h"
#include "color/metals.h"
#include "lobe_tests.h"
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

/// What scatters between two directions at the only point of a surface.
Rgb value(const Material& material, Vec3 wo, Vec3 wi) {
    ComponentArena arena;
    return material.bsdf(plane_point(wo), arena).eval(wo, wi, TransportMode::Radiance).f;
}

// A factor, an image of floating-point numbers or vertex colours may exceed the bound that constants are held to. Several
// models divide by 1 minus a colour.
TEST(MaterialMakers, TexturesAreClampedTo1WhereConstantsMustBe) {
    const Vec3 wo = direction(50, 20), back = direction(150, 20);
    int bounded = 0;
    for (const MaterialEntry& entry : material_registry())
        for (const ParamInfo& param : entry.info.params) {
            const char *type = entry.info.name, *name = param.name;
            if (param.kind != ParamKind::Texture ||
                refusal(type, {{name, Rgb(1.01f)}}).find("too large") == std::string::npos)
                continue;
            for (const Values& others :
                 {Values{}, Values{{"nonlinear", true}},
                  Values{{"base_metalness", 1.0}, {"specular_roughness", 1.0}},
                  Values{{"base_diffuse_roughness", 1.0}}, Values{{"transmission_weight", 1.0}}}) {
                TestMaterials materials;
                const auto textured = [&](float v) -> const Material* {
                    FunctionTexture texture;
                    texture.color = [v](Vec2) { return Rgb(v); };
                    try {
                        return &materials.make(type, others, {{name, materials.texture(texture)}});
                    } catch (const SceneError&) {
                        return nullptr;  // no parameter of the model
                    }
                };
                const Material *at_bound = textured(1), *above = textured(1.7f);
                if (!at_bound) continue;
                ++bounded;
                EXPECT_EQ(above->mean_albedo(), at_bound->mean_albedo()) << type << " " << name;
                for (const Vec3 wi : {direction(30, 150), back})
                    EXPECT_EQ(value(*above, wo, wi), value(*at_bound, wo, wi))
                        << type << " " << name;
            }
        }
    EXPECT_GT(bounded, 60);
}

}  // namespace
}  // namespace etendue
