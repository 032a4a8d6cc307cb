// The OpenPBR surface. False-alarm rate of the χ² tests of each TEST: 0.1 %.

#include "bsdf/openpbr.h"

#include "bsdf/conductor.h"
#include "bsdf/dielectric.h"
#include "bsdf/diffuse.h"
#include "bsdf/roughconductor.h"
#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;
using Values = std::vector<TestMaterials::Value>;
using Children = std::vector<TestMaterials::Child>;

/// A material and the lobes at a point that is seen from above.
class Made {
public:
    explicit Made(const Values& values,
                  const std::function<Children(TestMaterials&)>& textures = {})
        : material_(
              &materials_.make("openpbr", values, textures ? textures(materials_) : Children{})) {}

    const Material& operator*() const { return *material_; }
    // Lobes point to what the material owns, so that no temporary may make them.
    Bsdf bsdf(Vec3 wo = {0, 0, 1}) & { return material_->bsdf(plane_point(wo), arena_); }
    /// The only lobe.
    OpenPbrLobe lobe() & {
        const Bsdf made = bsdf();
        EXPECT_EQ(made.front().next, nullptr);
        return std::get<OpenPbrLobe>(made.front().lobe);
    }

private:
    TestMaterials materials_;
    ComponentArena arena_;
    const Material* material_;
};

Values operator+(Values a, const Values& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

const Values kWhite{{"base_color", Rgb(1)}};
const Values kMetal{{"base_metalness", 1.0}}, kGlass{{"transmission_weight", 1.0}};
const Values kCoat{{"coat_weight", 1.0}, {"coat_roughness", 0.3}},
    kSmoothCoat{{"coat_weight", 0.7}, {"coat_ior", 1.8}},
    kFuzz{{"fuzz_weight", 1.0}, {"fuzz_roughness", 0.3}};
const Values kBrushed{{"specular_roughness_anisotropy", 0.7}};
const Values kColors{{"base_color", Rgb(0.8f, 0.4f, 0.2f)},
                     {"specular_color", Rgb(0.9f, 1, 0.5f)},
                     {"transmission_color", Rgb(0.5f, 0.9f, 0.7f)}};

Values rough(double r) {
    return {{"specular_roughness", r}};
}

struct Named {
    const char* name;
    Values values;
};
/// Each slab and layer, in colours.
std::vector<Named> all_lobes() {
    const Values layers{{"coat_weight", 0.8},
                        {"coat_roughness", 0.2},
                        {"coat_color", Rgb(0.9f, 0.7f, 0.5f)},
                        {"fuzz_weight", 0.6},
                        {"fuzz_color", Rgb(0.6f, 0.9f, 0.8f)}};
    return {{"opaque", kColors},
            {"rough opaque", kColors + rough(0.8) + Values{{"base_diffuse_roughness", 0.7}}},
            {"smooth opaque", kColors + rough(0)},
            {"dull", kColors + Values{{"specular_weight", 0.0}}},
            {"metal", kColors + kMetal + rough(0.5)},
            {"brushed metal", kColors + kMetal + rough(0.6) + kBrushed},
            {"smooth metal under a rough coat", kColors + kMetal + rough(0) + kCoat},
            {"metal under a smooth coat", kColors + kMetal + rough(0.7) + kSmoothCoat},
            {"glass", kColors + kGlass + rough(0.4)},
            {"rough glass", kColors + kGlass + rough(0.9)},
            {"brushed metal of any slope", kMetal + rough(1) + kBrushed},
            {"dull brushed dielectric", rough(1) + kBrushed + Values{{"specular_color", Rgb(0)}}},
            {"brushed glass", kColors + kGlass + rough(0.6) + kBrushed},
            {"air in water", kColors + kGlass + rough(0.5) + Values{{"specular_ior", 0.75}}},
            {"coated glass", kColors + kGlass + rough(0.5) + layers},
            {"cloth", kColors + kFuzz},
            {"opaque below all", kColors + rough(0.6) + layers},
            {"metal below all", kColors + kMetal + layers},
            {"half metal", kColors + rough(0.4) + Values{{"base_metalness", 0.5}}},
            {"half metal below all", kColors + layers + Values{{"base_metalness", 0.5}}}};
}

TEST(OpenPbr, SamplesMatchPdf) {
    const std::vector<Vec3> directions = {direction(0, 0), direction(60, 130), direction(85, -70),
                                          direction(120, 20)};
    const double significance = sidak(1e-3, int(2 * all_lobes().size() * directions.size()));
    for (const auto& [name, values] : all_lobes()) {
        Made made(values);
        for (const Vec3 wo : directions) {
            SCOPED_TRACE(name);
            expect_samples_match_pdf(made.lobe(), wo, significance, 30000);
        }
    }
}

// Reciprocity is part of expect_adjoint_symmetry().
TEST(OpenPbr, ValueDensityAndWeightAgree) {
    for (const auto& [name, values] : all_lobes()) {
        SCOPED_TRACE(name);
        Made made(values);
        const OpenPbrLobe lobe = made.lobe();
        for (const Vec3 wo : test_directions_both_sides()) {
            expect_sample_agrees_with_eval(lobe, wo);
            expect_adjoint_symmetry(lobe, wo);
            expect_delta_events_reverse(lobe, wo);
        }
        expect_finite(lobe);
    }
}

TEST(OpenPbr, SmoothPartsAreDeltaEvents) {
    for (const auto& [values, has_smooth, has_delta] : std::vector<std::tuple<Values, bool, bool>>{
             {kMetal + rough(0), false, true},
             {kMetal + rough(0.2), true, false},
             {kGlass + rough(0), false, true},
             {rough(0), true, true},
             {rough(0) + Values{{"specular_weight", 0.0}}, true, false},
             {kMetal + rough(0) + kSmoothCoat, true, true},
             {kMetal + rough(0.3) + kSmoothCoat, true, true},
             {kMetal + rough(0) + kCoat, true, false}}) {
        Made made(values);
        EXPECT_EQ(made.lobe().has_smooth(), has_smooth);
        EXPECT_EQ(made.lobe().has_delta(), has_delta);
        EXPECT_EQ((*made).may_be_smooth(), has_smooth);
    }
}

/// ∫ f of the smooth part and of the delta events; of sharp lobes beside wide ones the mean of samples.
double albedo(const OpenPbrLobe& lobe, Vec3 wo, int channel = 1) {
    if (lobe.has_smooth() && lobe.roughness() < 0.03f && !lobe.is_glass())
        return double(sampled_albedo(lobe, wo, 512).value[channel]);
    double sum = lobe.has_smooth() ? integrated_albedo(lobe, wo, channel) : 0;
    for (const bool transmits : {false, true})
        if (const auto s = lobe.delta_event(wo, transmits))
            sum += double(s->weight[channel] * s->pdf);
    return sum;
}

struct Furnace {
    const char* name;
    Values values;
    double above = 0.005, below = 0.005;
};

class OpenPbrFurnace : public ::testing::TestWithParam<Furnace> {};

// In a white furnace, a white surface is invisible.
TEST_P(OpenPbrFurnace, IsClosedForWhiteSurfaces) {
    const auto& [name, values, above, below] = GetParam();
    for (const double r : {0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 1.0}) {
        Made made(kWhite + values + rough(r));
        const OpenPbrLobe lobe = made.lobe();
        for (const float cos : {1.0f, 0.8f, 0.5f, 0.2f, 0.1f, -0.1f, -0.3f, -0.7f, -1.0f}) {
            if (cos < 0 && !lobe.is_glass()) continue;
            const double a = albedo(lobe, {std::sqrt(1 - sqr(cos)), 0, cos});
            EXPECT_LE(a, 1 + above) << "roughness " << r << ", cosine " << cos;
            EXPECT_GE(a, 1 - below) << "roughness " << r << ", cosine " << cos;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(
    , OpenPbrFurnace,
    ::testing::Values(Furnace{"Metal", kMetal}, Furnace{"Opaque", {}}, Furnace{"Glass", kGlass},
                      Furnace{"HighIndex", {{"specular_ior", 3.0}}},
                      Furnace{"GlassOfHighIndex", kGlass + Values{{"specular_ior", 2.4}}},
                      Furnace{"AirInWater", kGlass + Values{{"specular_ior", 0.75}}},
                      Furnace{"RoughDiffuse", {{"base_diffuse_roughness", 1.0}}},
                      Furnace{"CoatedMetal", kMetal + kCoat}, Furnace{"CoatedOpaque", kCoat},
                      Furnace{"CoatedGlass", kGlass + kCoat},
                      Furnace{"SmoothlyCoatedMetal", kMetal + kSmoothCoat},
                      Furnace{"SmoothlyCoatedGlass", kGlass + kSmoothCoat},
                      Furnace{"FuzzyMetal", kMetal + kFuzz}, Furnace{"FuzzyOpaque", kFuzz},
                      Furnace{"FuzzyGlass", kGlass + kFuzz}, Furnace{"BrushedOpaque", kBrushed},
                      Furnace{"BrushedGlass", kGlass + kBrushed},
                      Furnace{"All", kCoat + kFuzz, 0.003, 0.003},
                      Furnace{"AllOverMetal", kMetal + kCoat + kFuzz, 0.003, 0.003},
                      Furnace{"AllOverGlass", kGlass + kCoat + kFuzz, 0.003, 0.003},
                      Furnace{"FuzzOverASmoothCoat", kSmoothCoat + kFuzz, 0.003, 0.003},
                      Furnace{"PartOfAll",
                              Values{{"coat_weight", 0.4},
                                     {"coat_roughness", 0.3},
                                     {"fuzz_weight", 0.6},
                                     {"fuzz_roughness", 0.3},
                                     {"base_metalness", 0.3}},
                              0.003, 0.003}),
    [](const auto& tested) { return tested.param.name; });

TEST(OpenPbr, AnisotropicMetalIsClosed) {
    for (const double anisotropy : {0.5, 0.8, 0.91, -0.91})
        for (const double r : {0.3, 0.6, 0.8, 1.0}) {
            Made made(kWhite + kMetal + rough(r) +
                      Values{{"specular_roughness_anisotropy", anisotropy}});
            for (const Vec3 wo :
                 {direction(0, 0), direction(40, 0), direction(40, 90), direction(70, 30),
                  direction(84, 6), direction(84, 45), direction(84, 84), direction(70, 75)})
                EXPECT_NEAR(albedo(made.lobe(), wo), 1, 0.005)
                    << anisotropy << " " << r << describe(wo);
        }
}

// Textures make a table of rows, between which the albedo is interpolated.
TEST(OpenPbr, TexturedRoughnessAndReflectanceAreClosed) {
    for (const Values& slab : {kMetal, Values{}, kGlass}) {
        float r = 0, weight = 0;
        Made made(kWhite + slab, [&](TestMaterials& m) {
            FunctionTexture roughness, specular;
            roughness.color = [&](Vec2) { return Rgb(r); };
            specular.color = [&](Vec2) { return Rgb(weight); };
            return Children{{"specular_roughness", m.texture(roughness)},
                            {"specular_weight", m.texture(specular)}};
        });
        for (const float rough_value : {0.05f, 0.33f, 0.71f, 0.98f})
            for (const float weight_value : {0.2f, 0.6f, 3.0f}) {
                r = rough_value;
                weight = weight_value;
                const OpenPbrLobe lobe = made.lobe();
                for (const float cos : {1.0f, 0.6f, 0.2f, 0.1f})
                    EXPECT_NEAR(albedo(lobe, {std::sqrt(1 - sqr(cos)), 0, cos}), 1, 0.005)
                        << "roughness " << r << ", weight " << weight << ", cosine " << cos;
            }
    }
}

/// Textures of one value each, which may change.
struct Textured {
    const char* name;
    Rgb value;
};
std::function<Children(TestMaterials&)> textures(std::vector<Textured>& all) {
    return [&all](TestMaterials& m) {
        Children children;
        for (Textured& t : all) {
            FunctionTexture texture;
            texture.color = [&t](Vec2) { return t.value; };
            children.push_back({t.name, m.texture(texture)});
        }
        return children;
    };
}

TEST(OpenPbr, TexturedRoughnessOfLayersIsClosed) {
    for (const Values& slab : {kMetal, Values{}, kGlass})
        for (const bool both : {false, true}) {
            std::vector<Textured> all{{"coat_roughness", Rgb(0)}, {"fuzz_roughness", Rgb(0)}};
            if (!both) all.pop_back();
            Made made(kWhite + slab + rough(0.3) +
                          Values{{"coat_weight", 1.0}, {"fuzz_weight", both ? 1.0 : 0.0}},
                      textures(all));
            for (const auto& [coat, fuzz] :
                 {std::pair{0.07f, 0.15f}, {0.33f, 0.4f}, {0.8f, 0.9f}}) {
                all[0].value = Rgb(coat);
                if (both) all[1].value = Rgb(fuzz);
                const OpenPbrLobe lobe = made.lobe();
                for (const float cos : {1.0f, 0.6f, 0.2f, 0.1f, -0.2f, -0.8f}) {
                    if (cos < 0 && !lobe.is_glass()) continue;
                    EXPECT_NEAR(albedo(lobe, {std::sqrt(1 - sqr(cos)), 0, cos}), 1, 0.01)
                        << "coat " << coat << ", fuzz " << fuzz << ", cosine " << cos;
                }
            }
        }
}

// Every parameter of the layers takes a texture. Tables between whose rows is interpolated are within 2 %.
TEST(OpenPbr, TexturesOfLayersAreLikeNumbers) {
    const Values base = kColors + rough(0.5) +
                        Values{{"coat_weight", 0.9}, {"fuzz_weight", 0.8}, {"base_metalness", 0.2}};
    const double significance = sidak(1e-3, 10);
    for (const auto& [name, value, tolerance] :
         {std::tuple("coat_color", Rgb(0.9f, 0.6f, 0.3f), 1e-4),
          {"coat_roughness", Rgb(0.37f), 0.02},
          {"fuzz_color", Rgb(0.3f, 0.9f, 0.6f), 1e-4},
          {"fuzz_roughness", Rgb(0.43f), 0.02},
          {"base_diffuse_roughness", Rgb(0.6f), 1e-4}}) {
        const bool is_color = value.r != value.g;
        std::vector<Textured> texture{{name, value}};
        Made textured(base, textures(texture)),
            constant(base + Values{{name, is_color ? ParamValue(value) : double(value.r)}}),
            without(base);
        double most = 0;
        for (const Vec3 wo : test_directions())
            for (const Vec3 wi : test_directions()) {
                const Rgb a = textured.lobe().eval(wo, wi).f, b = constant.lobe().eval(wo, wi).f;
                EXPECT_TRUE(nearly(a, b, tolerance, 1e-6))
                    << name << describe(wo) << describe(wi) << a.g << " " << b.g;
                most = std::max(most, double(std::fabs(b.b - without.lobe().eval(wo, wi).f.b)));
            }
        EXPECT_GT(most, 1e-3) << name;
        for (const Vec3 wo : {direction(20, 0), direction(75, 50)})
            expect_samples_match_pdf(textured.lobe(), wo, significance, 30000);
        expect_adjoint_symmetry(textured.lobe(), direction(50, 10));
        expect_finite(textured.lobe());
    }
}

// Nearer to the horizon, albedos change faster with the roughness than between rows.
TEST(OpenPbr, TexturedRoughnessIsNearlyClosedAtTheHorizon) {
    float r = 0;
    Made made(kWhite + kMetal, [&](TestMaterials& m) {
        FunctionTexture roughness;
        roughness.color = [&](Vec2) { return Rgb(r); };
        return Children{{"specular_roughness", m.texture(roughness)}};
    });
    for (const float value : {0.03f, 0.06f, 0.1f, 0.3f, 0.7f})
        for (const float cos : {0.05f, 0.02f, 0.01f}) {
            r = value;
            EXPECT_NEAR(albedo(made.lobe(), {std::sqrt(1 - sqr(cos)), 0, cos}), 1, 0.014)
                << "roughness " << r << ", cosine " << cos;
        }
}

// Of a texture, too: then its table is interpolated towards rough facets.
TEST(OpenPbr, SmoothFacetsScatterNothingButDeltaEvents) {
    for (const Values& slab : {kGlass, kMetal, kGlass + Values{{"specular_ior", 0.75}}}) {
        Made made(kWhite + slab, [&](TestMaterials& m) {
            FunctionTexture roughness;
            roughness.color = [](Vec2) { return Rgb(2 / 255.0f); };
            return Children{{"specular_roughness", m.texture(roughness)}};
        });
        const OpenPbrLobe lobe = made.lobe();
        ASSERT_FALSE(lobe.has_smooth());
        for (const float cos : {1.0f, 0.1f, 0.01f, 0.001f, -0.01f}) {
            if (cos < 0 && !lobe.is_glass()) continue;
            const Vec3 wo{std::sqrt(1 - sqr(cos)), 0, cos};
            double sum = 0;
            for (const bool transmits : {false, true})
                if (const auto s = lobe.delta_event(wo, transmits)) sum += double(s->pdf);
            EXPECT_NEAR(sum, 1, 1e-6) << cos;
            constexpr int kSamples = 1000;
            int delta = 0;
            for (int i = 0; i < kSamples; ++i)
                if (const auto s = lobe.sample(wo, (float(i) + 0.5f) / kSamples, {0.3f, 0.7f}))
                    delta += s->is_delta;
            EXPECT_EQ(delta, kSamples) << cos;
        }
    }
}

// The reference mixes roughnesses, not their fourth powers, so that a thin coat hardly blurs a mirror.
TEST(OpenPbr, ACoatRoughensWhatLiesBelowByItsWeight) {
    for (const double base : {0.0, 0.2, 0.9})
        for (const double coat : {0.0, 0.3, 0.8})
            for (const double weight : {0.1, 0.5, 1.0}) {
                const double below =
                    std::pow(std::min(1.0, std::pow(base, 4) + 2 * std::pow(coat, 4)), 0.25);
                Made made(kMetal + rough(base) +
                          Values{{"coat_weight", weight}, {"coat_roughness", coat}});
                EXPECT_NEAR(double(made.lobe().surface_roughness), base + weight * (below - base),
                            1e-5)
                    << base << " " << coat << " " << weight;
            }
}

// Other formats have a coat that does not.
TEST(OpenPbr, ACoatMayLeaveTheRoughnessAsItIs) {
    const Values coated = kMetal + kCoat + rough(0.1);
    const auto at = [&](double share) {
        Made made(coated + Values{{"coat_affect_roughness", share}});
        return double(made.lobe().surface_roughness);
    };
    EXPECT_NEAR(at(0), 0.1, 1e-5);
    EXPECT_NEAR(at(0.25), 0.75 * 0.1 + 0.25 * at(1), 1e-5);
    EXPECT_GT(at(1), 0.3);
}

// η_s of the reference: the index relative to the coat, by its weight, and its inverse where that is below 1.
TEST(OpenPbr, TheIndexBelowACoatIsRelativeToIt) {
    const auto eta = [](const Values& values) {
        Made made(values + Values{{"coat_weight", 1.0}});
        return double(made.lobe().eta);
    };
    const double relative = 1.6 / 1.5;
    EXPECT_NEAR(eta({}), relative, 1e-6);
    EXPECT_NEAR(eta({{"coat_weight", 0.25}}), 0.75 * 1.5 + 0.25 * relative, 1e-6);
    EXPECT_NEAR(eta({{"coat_affect_ior", 0.5}}), 0.5 * 1.5 + 0.5 * relative, 1e-6);
    EXPECT_NEAR(eta({{"coat_affect_ior", 0.0}}), 1.5, 1e-6);
    EXPECT_NEAR(eta({{"specular_ior", 2.0}}), 1.25, 1e-6);
    EXPECT_NEAR(eta({{"coat_ior", 1.0}}), 1.5, 1e-6);
    // The weight is a factor of the reflectance below the coat.
    const double root = 0.5 * (relative - 1) / (relative + 1);
    EXPECT_NEAR(eta({{"specular_weight", 0.25}}), (1 + root) / (1 - root), 1e-6);
    // Light that passes coat and glass is refracted as without the coat.
    EXPECT_NEAR(eta(kGlass), 1.5, 1e-6);
    EXPECT_LT(eta({{"specular_ior", 0.75}}), 1);
}

// A negative anisotropy stretches along v.
TEST(OpenPbr, NegativeAnisotropyIsAQuarterTurn) {
    const Values metal = kColors + kMetal + rough(0.5);
    Made one(metal + Values{{"specular_roughness_anisotropy", 0.7}}),
        turned_one(metal + Values{{"specular_roughness_anisotropy", -0.7}});
    const OpenPbrLobe along_u = one.lobe(), along_v = turned_one.lobe();
    const auto turned = [](Vec3 w) { return Vec3{w.y, -w.x, w.z}; };
    for (const Vec3 wo : test_directions())
        for (const Vec3 wi : test_directions())
            EXPECT_TRUE(
                nearly(along_u.eval(wo, wi).f, along_v.eval(turned(wo), turned(wi)).f, 1e-3, 1e-6))
                << describe(wo) << describe(wi);
}

// Facets with an α up to the least one along one direction may be rough along the other.
TEST(OpenPbr, StretchedFacetsAreSmoothWhereTheirLobeIs) {
    const double root = std::sqrt(double(Microfacet::kMinAlpha));
    for (const double r : {0.99 * root, 1.01 * root, 0.5 * root}) {
        Made made(kMetal + rough(r) + Values{{"specular_roughness_anisotropy", 0.9}});
        EXPECT_EQ((*made).may_be_smooth(), made.lobe().has_smooth()) << r / root;
        EXPECT_EQ((*made).may_have_delta(), made.lobe().has_delta()) << r / root;
    }
}

TEST(OpenPbr, TheEstimateOfTheAlbedoHasTheLayers) {
    const auto albedo_of = [](const Values& values) {
        Made made(kMetal + Values{{"base_color", Rgb(0.5f)}} + values);
        return made.lobe().albedo_estimate();
    };
    const Rgb coated =
        albedo_of({{"coat_weight", 1.0}, {"coat_ior", 1.5}, {"coat_color", Rgb(0.1f, 0.5f, 1)}});
    EXPECT_TRUE(nearly(coated, Rgb(0.04f) + 0.96f * 0.5f * Rgb(0.1f, 0.5f, 1), 1e-4, 0));
    const Rgb fuzzy = albedo_of(Values{{"fuzz_color", Rgb(1, 0, 0)}} + kFuzz),
              tinted = albedo_of(Values{{"fuzz_color", Rgb(0.5f)}} + kFuzz);
    EXPECT_GT(fuzzy.r, 0.5f);
    EXPECT_LT(fuzzy.g, 0.5f);
    EXPECT_NEAR(tinted.r, 0.5f, 1e-4f);
}

TEST(OpenPbr, ATexturedCoatIsClosed) {
    for (const Values& slab : {Values{}, Values{{"base_metalness", 0.4}}}) {
        std::vector<Textured> all{{"coat_weight", Rgb(0)}};
        Made made(kWhite + slab + rough(0.4) + Values{{"coat_roughness", 0.2}}, textures(all));
        for (const float weight : {0.0f, 0.3f, 0.7f, 1.0f}) {
            all[0].value = Rgb(weight);
            const OpenPbrLobe lobe = made.lobe();
            for (const float cos : {1.0f, 0.6f, 0.2f, 0.1f})
                EXPECT_NEAR(albedo(lobe, {std::sqrt(1 - sqr(cos)), 0, cos}), 1, 0.005)
                    << "weight " << weight << ", cosine " << cos;
        }
    }
}

TEST(OpenPbr, ThinWalledSurfacesReflectOnBothSides) {
    for (const double transmission : {0.0, 0.5}) {
        Made thin(Values{{"thin_walled", true}, {"transmission_weight", transmission}});
        EXPECT_TRUE((*thin).is_two_sided());
        const auto reflected = [&](Vec3 wo) {
            ComponentArena arena;
            return (*thin)
                .bsdf(plane_point(wo), arena)
                .eval(wo, {-wo.x, 0, wo.z}, TransportMode::Radiance)
                .f.g;
        };
        EXPECT_GT(reflected(direction(30, 0)), 0.02f);
        EXPECT_EQ(reflected(direction(30, 0)), reflected(direction(150, 0)));
    }
}

// Light that is in the ball meets the opaque half from behind.
TEST(OpenPbr, HalfTransmissionIsClosedFromBothSides) {
    for (const double share : {0.5, 0.9}) {
        Made made(kWhite + rough(0.5) +
                  Values{{"transmission_weight", share}, {"base_metalness", 0.3}});
        EXPECT_TRUE((*made).is_transmissive() && (*made).is_two_sided());
        for (const Vec3 wo : test_directions_both_sides()) {
            const Bsdf bsdf = made.bsdf(wo);
            double sum = 0;
            for (const BsdfComponent* c = &bsdf.front(); c; c = c->next)
                sum += double(c->weight) *
                       albedo(std::get<OpenPbrLobe>(c->lobe), c->frame.to_local(wo));
            EXPECT_NEAR(sum, 1, 0.005) << share << describe(wo);
        }
    }
}

TEST(OpenPbr, NeverGainsEnergy) {
    LobeRandom random(9);
    for (int i = 0; i < 60; ++i) {
        const auto number = [&] { return double(random.next()); };
        const auto color = [&] { return Rgb(random.next(), random.next(), random.next()); };
        const auto maybe = [&] { return random.next() < 0.4f ? double(random.next()) : 0.0; };
        const Values slab = i % 3 == 0 ? kMetal : i % 3 == 1 ? Values{} : kGlass;
        Made made(slab + Values{{"base_color", color()},
                                {"specular_color", color()},
                                {"transmission_color", color()},
                                {"specular_roughness", 0.1 + 0.9 * number()},
                                {"specular_weight", 2 * number()},
                                {"specular_ior", 1 + 2 * number()},
                                {"base_diffuse_roughness", maybe()},
                                {"coat_weight", maybe()},
                                {"coat_color", color()},
                                {"coat_roughness", number()},
                                {"fuzz_weight", maybe()},
                                {"fuzz_color", color()},
                                {"fuzz_roughness", number()}});
        for (const Vec3 wo :
             {direction(5, 0), direction(60, 20), direction(80, 50), direction(140, 0)})
            for (const int channel : {0, 2})
                EXPECT_LE(albedo(made.lobe(), wo, channel), 1.005) << "set " << i << describe(wo);
    }
}

// A metal of reflectance above 1 would gain without bound, or reflect less than no light.
TEST(OpenPbr, TexturesAbove1NeitherGainNorTurnNegative) {
    for (const Values& slab : {kMetal, Values{}, kGlass})
        for (const float color : {1.2f, 1.5f, 1.8f, 4.0f})
            for (const double r : {0.3, 0.7, 1.0}) {
                Made made(slab + rough(r), [&](TestMaterials& m) {
                    FunctionTexture bright;
                    bright.color = [color](Vec2) { return Rgb(color); };
                    return Children{{"base_color", m.texture(bright)},
                                    {"transmission_color", m.texture(bright)}};
                });
                const OpenPbrLobe lobe = made.lobe();
                for (const Vec3 wo : {direction(10, 0), direction(45, 0), direction(80, 0)}) {
                    EXPECT_LE(albedo(lobe, wo), 1.005) << color << " " << r << describe(wo);
                    for (const Vec3 wi : test_directions_both_sides())
                        EXPECT_GE(lobe.eval(wo, wi).f.r, 0) << color << " " << r << describe(wo);
                }
            }
}

TEST(OpenPbr, WithoutReflectionIsDiffuse) {
    Made made(
        {{"base_color", Rgb(0.2f, 0.6f, 0.3f)}, {"base_weight", 0.5}, {"specular_weight", 0.0}});
    const DiffuseLobe diffuse{Rgb(0.1f, 0.3f, 0.15f)};
    for (const Vec3 wo : test_directions_both_sides())
        for (const Vec3 wi : test_directions_both_sides()) {
            const BsdfEval a = made.lobe().eval(wo, wi), b = diffuse.eval(wo, wi);
            EXPECT_TRUE(nearly(a.f, b.f, 1e-4, 1e-7)) << describe(wo) << describe(wi);
            EXPECT_TRUE(nearly(a.pdf, b.pdf, 1e-4, 1e-7)) << describe(wo) << describe(wi);
        }
}

TEST(OpenPbr, SmoothGlassIsADielectric) {
    Made made(kGlass + rough(0) +
              Values{{"transmission_color", Rgb(0.25f, 0.49f, 1)}, {"specular_ior", 1.7}});
    const DielectricLobe reference{1.7f, Rgb(1), Rgb(0.5f, 0.7f, 1)};
    for (const Vec3 wo : test_directions_both_sides())
        for (const bool transmits : {false, true}) {
            const auto a = made.lobe().delta_event(wo, transmits),
                       b = reference.delta_event(wo, transmits);
            ASSERT_EQ(a.has_value(), b.has_value()) << describe(wo);
            if (!a) continue;
            EXPECT_LT(length(a->wi - b->wi), 1e-6f);
            EXPECT_TRUE(nearly(a->weight, b->weight, 1e-5, 0) && nearly(a->pdf, b->pdf, 1e-5, 0) &&
                        nearly(a->pdf_rev, b->pdf_rev, 1e-5, 0))
                << describe(wo);
            EXPECT_EQ(a->eta, b->eta);
        }
}

// At 0 roughness the mirror of a conductor; of low roughness, where little light is reflected twice, a rough conductor.
TEST(OpenPbr, MetalIsAConductor) {
    const ConductorLobe mirror{Rgb(0), Rgb(1), Rgb(1)};
    Made smooth(kWhite + kMetal + rough(0)), low(kWhite + kMetal + rough(0.1));
    const RoughConductorLobe ggx{{Microfacet::Kind::Ggx, 0.01f, 0.01f}, Rgb(0), Rgb(1), Rgb(1)};
    for (const Vec3 wo : test_directions()) {
        const auto a = smooth.lobe().sample(wo, 0.3f, {0.2f, 0.7f}),
                   b = mirror.sample(wo, 0.3f, {0.2f, 0.7f});
        ASSERT_TRUE(a && b && a->is_delta);
        EXPECT_LT(length(a->wi - b->wi), 1e-6f);
        EXPECT_TRUE(nearly(a->weight, b->weight, 1e-5, 0) && a->pdf == b->pdf);
        const auto s = ggx.sample(wo, 0, {0.4f, 0.3f});
        ASSERT_TRUE(s);
        EXPECT_TRUE(nearly(low.lobe().eval(wo, s->wi).f, s->weight * s->pdf, 2e-3, 0))
            << describe(wo);
    }
}

// At 82° F82-tint has the given share of Schlick's approximation, at 0° the base colour.
TEST(OpenPbr, MetalHasTheColourOfItsEdge) {
    const Rgb base(0.9f, 0.5f, 0.1f), tint(0.3f, 0.8f, 1);
    Made made(kMetal + rough(0) + Values{{"base_color", base}, {"specular_color", tint}});
    const auto F = [&](float cos) {
        const auto s = made.lobe().delta_event({std::sqrt(1 - sqr(cos)), 0, cos}, false);
        return s->weight * s->pdf;
    };
    EXPECT_TRUE(nearly(F(1), base, 1e-5, 0));
    const float c = 1 / 7.0f;
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(F(c)[i], tint[i] * (base[i] + (1 - base[i]) * std::pow(1 - c, 5.0f)), 1e-5f);
}

// What does not leave at the facets is multiplied by the base colour once.
TEST(OpenPbr, OpaqueAlbedoIsThatOfAlbedoScaling) {
    for (const double r : {0.0, 0.4}) {
        const auto of = [&](double base, const Vec3 wo) {
            Made made(rough(r) + Values{{"base_color", Rgb(float(base))}});
            return albedo(made.lobe(), wo);
        };
        for (const Vec3 wo : test_directions()) {
            const double E = of(0, wo);
            EXPECT_NEAR(of(0.3, wo), E + 0.3 * (1 - E), 0.002) << r << describe(wo);
        }
    }
}

TEST(OpenPbr, ReflectanceAtNormalIncidenceIsWeighted) {
    const Vec3 n{0, 0, 1};
    const auto F0 = [&](const Values& values) {
        Made made(rough(0) + Values{{"base_color", Rgb(0)}} + values);
        const auto s = made.lobe().delta_event(n, false);
        return s ? s->weight * s->pdf : Rgb(0);
    };
    const auto weight = [](double w) { return Values{{"specular_weight", w}}; };
    EXPECT_NEAR(F0({}).g, 0.04f, 1e-6f);
    EXPECT_NEAR(F0(weight(0.25)).g, 0.01f, 1e-6f);
    EXPECT_EQ(F0(weight(0)).g, 0);
    EXPECT_NEAR(F0(weight(2)).g, 0.08f, 1e-6f);
    EXPECT_NEAR(F0(weight(0.5) + Values{{"specular_ior", 0.6}}).g, 0.5f * sqr(0.4f / 1.6f), 1e-6f);
    const Rgb tinted = F0({{"specular_color", Rgb(3, 1.5f, 0)}});
    EXPECT_TRUE(nearly(tinted, Rgb(0.12f, 0.06f, 0), 1e-5, 1e-7)) << tinted.r << " " << tinted.g;
}

TEST(OpenPbr, ACoatColoursWhatLiesBelow) {
    const Vec3 n{0, 0, 1};
    Made made(kWhite + kMetal + rough(0) +
              Values{{"coat_weight", 1.0}, {"coat_ior", 1.5}, {"coat_color", Rgb(0.5f, 0.8f, 1)}});
    const auto s = made.lobe().delta_event(n, false);
    ASSERT_TRUE(s);
    EXPECT_TRUE(nearly(s->weight * s->pdf, Rgb(0.04f) + Rgb(0.5f, 0.8f, 1) * 0.96f, 1e-5, 0));
}

TEST(OpenPbr, MaterialReadsItsParameters) {
    EXPECT_FALSE((*Made(Values{})).is_transmissive());
    EXPECT_FALSE((*Made(Values{})).is_two_sided());
    for (const TestMaterials::Value& wrong : Values{{"base_color", Rgb(1.5f)},
                                                    {"specular_roughness", 1.5},
                                                    {"coat_ior", 0.9},
                                                    {"specular_ior", 0.0},
                                                    {"fuzz_roughness", 2.0},
                                                    {"coat_color", Rgb(0.5f, 1.1f, 1)},
                                                    {"fuzz_color", Rgb(1.1f)},
                                                    {"specular_roughness_anisotropy", -1.1},
                                                    {"coat_affect_ior", 1.1},
                                                    {"coat_affect_roughness", -0.1}})
        EXPECT_THROW(Made(Values{{"coat_weight", 1.0}, {"fuzz_weight", 1.0}, wrong}), SceneError)
            << wrong.name;
    // Metal and dielectric are one component, glass is another one.
    Made metal(kMetal + rough(0.5));
    const Bsdf both = metal.bsdf();
    EXPECT_EQ(both.front().weight, 1);
    Made mixed(Values{{"base_metalness", 0.25}, {"transmission_weight", 0.4}});
    const Bsdf two = mixed.bsdf();
    float sum = 0;
    int count = 0;
    for (const BsdfComponent* c = &two.front(); c; c = c->next) sum += c->weight, ++count;
    EXPECT_EQ(count, 2);
    EXPECT_FLOAT_EQ(sum, 1);
    Made thin(kGlass + Values{{"thin_walled", true}, {"transmission_color", Rgb(0.5f)}});
    const Bsdf pane = thin.bsdf();
    EXPECT_EQ(std::get<ThinDielectricLobe>(pane.front().lobe).transmittance, Rgb(0.5f));
    // The sharpest lobe counts.
    Made base(rough(0.5)), coated(kMetal + rough(0.5) + kCoat);
    EXPECT_FLOAT_EQ(base.lobe().roughness(), 0.25f);
    EXPECT_FLOAT_EQ(coated.lobe().roughness(), 0.09f);
}

}  // namespace
}  // namespace etendue
