// Materials of several components, tested as one lobe: χ², adjoint symmetry, energy.

#include "bsdf/bsdf.h"
#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

/// A material on the plane z = 0, as the tests of lobes see it. Values are without the η² of radiance.
struct MaterialLobe {
    const Material* material;

    BsdfEval eval(Vec3 wo, Vec3 wi) const {
        ComponentArena arena;
        return at(wo, arena).eval(wo, wi, TransportMode::Importance);
    }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const {
        ComponentArena arena;
        return at(wo, arena).sample(wo, u_lobe, u, TransportMode::Importance);
    }
    float max_pdf(Vec3 wo, const DirectionCone& cone) const {
        ComponentArena arena;
        return at(wo, arena).max_pdf(wo, cone);
    }

private:
    Bsdf at(Vec3 wo, ComponentArena& arena) const { return material->bsdf(plane_point(wo), arena); }
};

std::vector<const Material*> lobe_sums(TestMaterials& m) {
    return {&m.make("lobesum", {{"diffuse_reflectance", 0.3},
                                {"glossy_reflectance", 0.5},
                                {"distribution", std::string("ggx")},
                                {"alpha", 0.3}}),
            &m.make("lobesum", {{"diffuse_reflectance", 0.4},
                                {"glossy_reflectance", 0.0},
                                {"specular_reflectance", 0.3},
                                {"specular_transmittance", 0.2}}),
            &m.make("lobesum", {{"diffuse_reflectance", 0.3},
                                {"diffuse_transmittance", 0.2},
                                {"glossy_reflectance", 0.4},
                                {"alpha", 0.4}}),
            &m.make("lobesum", {{"diffuse_reflectance", 0.2},
                                {"glossy_reflectance", 0.3},
                                {"glossy_transmittance", 0.5},
                                {"alpha", 0.4}})};
}

const Material& mixture(TestMaterials& m, const std::string& weights, bool ensures = true) {
    const int diffuse = m.bsdf("diffuse", {{"reflectance", 0.8}}),
              metal = m.bsdf("roughconductor", {{"alpha", 0.3}});
    return m.make("mixturebsdf", {{"weights", weights}, {"ensure_energy_conservation", ensures}},
                  {{"", diffuse}, {"", metal}});
}

void check(const Material& material, Vec3 wo, double significance) {
    const MaterialLobe lobe{&material};
    expect_samples_match_pdf(lobe, wo, significance, 30000);
    expect_sample_agrees_with_eval(lobe, wo, 3e-3, 500);
    expect_adjoint_symmetry(lobe, wo, 3e-3, 500);
    expect_energy_conserved(lobe, wo);
}

TEST(Mixtures, LobeSumsAgreeWithTheirDensities) {
    TestMaterials m;
    const auto materials = lobe_sums(m);
    const double significance =
        sidak(1e-3, int(2 * materials.size() * test_directions_both_sides().size()));
    for (const Material* material : materials)
        for (const Vec3 wo : test_directions_both_sides()) check(*material, wo, significance);
}

TEST(Mixtures, WeightedSumsAgreeWithTheirDensities) {
    TestMaterials m;
    const double significance = sidak(1e-3, int(2 * 2 * test_directions().size()));
    for (const char* weights : {"0.3, 0.5", "0.4 0.6"})
        for (const Vec3 wo : test_directions()) check(mixture(m, weights), wo, significance);
}

/// The factors of the values may exceed one in sum; the probabilities of the parts do not.
TEST(Mixtures, SumsAboveOneAgreeWithTheirDensities) {
    TestMaterials m;
    const Material& above = mixture(m, "0.9 0.7", false);
    const MaterialLobe lobe{&above}, scaled{&mixture(m, "0.9 0.7")};
    const double significance = sidak(1e-3, int(2 * test_directions().size()));
    LobeRandom random(31);
    for (const Vec3 wo : test_directions()) {
        expect_samples_match_pdf(lobe, wo, significance, 30000);
        expect_sample_agrees_with_eval(lobe, wo, 3e-3, 500);
        expect_adjoint_symmetry(lobe, wo, 3e-3, 500);
        for (int i = 0; i < 100; ++i) {
            const Vec3 wi = sample_uniform_sphere(random.next_2d());
            const BsdfEval a = lobe.eval(wo, wi), b = scaled.eval(wo, wi);
            EXPECT_TRUE(nearly(a.f, b.f * 1.6f, 1e-5, 0));
            EXPECT_TRUE(nearly(a.pdf, b.pdf, 1e-5, 0));
            EXPECT_TRUE(nearly(a.pdf_rev, b.pdf_rev, 1e-5, 0));
        }
    }
}

/// The sum of mirror, glass and diffuse parts with factors above one: delta events have probabilities, too.
TEST(Mixtures, DeltaEventsOfSumsAboveOneHaveProbabilities) {
    TestMaterials m;
    const Material& material =
        m.make("mixturebsdf",
               {{"weights", std::string("1.5 0.9 0.6")}, {"ensure_energy_conservation", false}},
               {{"", m.bsdf("dielectric")}, {"", m.bsdf("conductor")}, {"", m.bsdf("diffuse")}});
    ComponentArena arena;
    for (const Vec3 wo : test_directions())
        for (const auto mode : {TransportMode::Radiance, TransportMode::Importance}) {
            const Bsdf bsdf = material.bsdf(plane_point(wo), arena);
            EXPECT_NEAR(bsdf.delta_probability(wo, mode), 2.4 / 3, 1e-5);
            LobeRandom random(32);
            for (int i = 0; i < 200; ++i) {
                const float u = random.next();
                const auto s = bsdf.sample(wo, u, random.next_2d(), mode);
                ASSERT_TRUE(s);
                if (!s->is_delta) continue;
                const auto again = bsdf.sample_delta(wo, s->event, mode);
                ASSERT_TRUE(again);
                EXPECT_EQ(describe(s->wi), describe(again->wi));
                EXPECT_TRUE(nearly(s->weight, again->weight, 1e-6, 0));
                EXPECT_TRUE(nearly(s->pdf, again->pdf, 1e-6, 0));
                EXPECT_TRUE(nearly(s->pdf_rev, again->pdf_rev, 1e-6, 0));
            }
        }
    const MaterialLobe mirror{&m.make(
        "mixturebsdf", {{"weights", std::string("1.7")}, {"ensure_energy_conservation", false}},
        {{"", m.bsdf("conductor")}})};
    const MaterialLobe once{&m.make("conductor")};
    const Vec3 wo = direction(40, 20);
    EXPECT_TRUE(
        nearly(mirror.sample(wo, 0, {})->weight, once.sample(wo, 0, {})->weight * 1.7f, 1e-6, 0));
    EXPECT_EQ(mirror.sample(wo, 0, {})->pdf, 1);
}

/// What remains of a sum if other parts have no lobe, or no weight.
std::vector<const Material*> parts_of_mixtures(TestMaterials& m) {
    const auto mixed = [&](const char* weights, std::vector<int> parts) {
        std::vector<TestMaterials::Child> children;
        for (const int part : parts) children.push_back({"", part});
        return &m.make("mixturebsdf", {{"weights", std::string(weights)}}, children);
    };
    const auto black = [&] {
        return m.bsdf("lobesum", {{"diffuse_reflectance", 0.0}, {"glossy_reflectance", 0.0}});
    };
    std::vector<const Material*> all;
    for (const auto& [type, values] :
         std::vector<std::pair<const char*, std::vector<TestMaterials::Value>>>{
             {"diffuse", {{"reflectance", 0.8}}},
             {"orennayar", {}},
             {"diffusetransmission", {}},
             {"conductor", {}},
             {"roughconductor", {{"alpha", 0.3}}},
             {"dielectric", {}},
             {"roughdielectric", {{"alpha", 0.3}}},
             {"plastic", {}}}) {
        all.push_back(mixed("0.5", {m.bsdf(type, values)}));
        all.push_back(mixed("0.4, 0", {m.bsdf(type, values), m.bsdf("diffuse")}));
        all.push_back(mixed("0.6, 0.4", {black(), m.bsdf(type, values)}));
        all.push_back(
            &m.make("blendbsdf", {{"weight", 0.3}}, {{"", black()}, {"", m.bsdf(type, values)}}));
    }
    return all;
}

TEST(Mixtures, PartsOfMixturesAgreeWithTheirDensities) {
    TestMaterials m;
    const auto materials = parts_of_mixtures(m);
    const std::vector<Vec3> directions{direction(20, 0), direction(60, 130)};
    const double significance = sidak(1e-3, int(2 * materials.size() * directions.size()));
    for (const Material* material : materials)
        for (const Vec3 wo : directions) check(*material, wo, significance);
}

TEST(Mixtures, WeightsScaleTheAlbedoOfAPart) {
    TestMaterials m;
    const Vec3 wo = direction(40, 20);
    for (const char* type : {"diffuse", "conductor", "roughconductor", "plastic"}) {
        const MaterialLobe whole{&m.make(type)},
            half{&m.make("mixturebsdf", {{"weights", std::string("0.5")}}, {{"", m.bsdf(type)}})};
        const Albedo a = sampled_albedo(whole, wo), b = sampled_albedo(half, wo);
        EXPECT_NEAR(b.value.g, 0.5f * a.value.g,
                    5 * (a.standard_error.g + b.standard_error.g) + 1e-6f)
            << type;
    }
}

TEST(Mixtures, WeightsAboveOneAreScaled) {
    TestMaterials m;
    const Vec3 wo = direction(30, 0), wi = direction(20, 170);
    const MaterialLobe half{&mixture(m, "0.5 0.5")}, twice{&mixture(m, "1 1")};
    EXPECT_FLOAT_EQ(half.eval(wo, wi).f.g, twice.eval(wo, wi).f.g);
    EXPECT_THROW(mixture(m, "1"), SceneError);
    EXPECT_THROW(mixture(m, "1 x"), SceneError);
    EXPECT_THROW(mixture(m, "1 -1"), SceneError);
}

TEST(Mixtures, WeightsAboveOneAreKeptWithoutConservation) {
    TestMaterials m;
    const auto make = [&](const char* weights, bool ensures) {
        const int a = m.bsdf("diffuse", {{"reflectance", 0.4}}),
                  b = m.bsdf("diffuse", {{"reflectance", 0.5}});
        return &m.make("mixturebsdf",
                       {{"weights", std::string(weights)}, {"ensure_energy_conservation", ensures}},
                       {{"", a}, {"", b}});
    };
    const Vec3 wo = direction(30, 0), wi = direction(20, 170);
    EXPECT_FLOAT_EQ(MaterialLobe{make("0.3 0.4", false)}.eval(wo, wi).f.g, 0.32f * kInvPi * wi.z);
    EXPECT_FLOAT_EQ(MaterialLobe{make("0.9 0.4", true)}.eval(wo, wi).f.g,
                    0.56f / 1.3f * kInvPi * wi.z);
    EXPECT_FLOAT_EQ(MaterialLobe{make("0.9 0.4", false)}.eval(wo, wi).f.g, 0.56f * kInvPi * wi.z);
    EXPECT_TRUE(
        nearly(sampled_albedo(MaterialLobe{make("0.9 0.4", false)}, wo).value.g, 0.56, 1e-5, 0));
}

// Also where nothing is reflected by the dielectric part.
TEST(Mixtures, OwnReflectancesAgreeWithTheirDensities) {
    TestMaterials m;
    const auto make = [&](double weight, Rgb color) {
        return &m.make("principled", {{"base_color", Rgb(0.3f, 0.5f, 0.2f)},
                                      {"roughness", 0.6},
                                      {"clearcoat", 0.4},
                                      {"specular_weight", weight},
                                      {"specular_color", color}});
    };
    const double significance = sidak(1e-3, int(2 * 2 * test_directions().size()));
    for (const Material* material : {make(0.8, {9, 4, 0}), make(1, Rgb(0))})
        for (const Vec3 wo : test_directions()) check(*material, wo, significance);
}

// α of 0.25 = (16/32)² is one of the roughnesses that have a transmittance of their own.
TEST(Mixtures, TexturedRoughPlasticIsThatOfItsRoughness) {
    TestMaterials m;
    FunctionTexture alpha;
    alpha.color = [](Vec2) { return Rgb(0.25f); };
    const MaterialLobe textured{&m.make("roughplastic", {}, {{"alpha", m.texture(alpha)}})},
        constant{&m.make("roughplastic", {{"alpha", 0.25}})};
    for (const Vec3 wo : test_directions()) {
        const Vec3 wi = direction(50, 120);
        EXPECT_TRUE(nearly(textured.eval(wo, wi).f, constant.eval(wo, wi).f, 1e-5, 0));
    }
}

// Numbers of delta events have eight bits.
TEST(Mixtures, TellAllDeltaEventsApart) {
    TestMaterials m;
    // The second material is the last one of the list.
    const auto mixed = [&](int diffuse, const char* second) {
        std::vector<TestMaterials::Child> children(size_t(diffuse),
                                                   {"", m.bsdf("diffuse", {{"reflectance", 0.5}})});
        children.insert(children.begin() + 1, {"", m.bsdf(second)});
        std::string weights = "0.001 0.5";
        for (int i = 1; i < diffuse; ++i) weights += " 0.001";
        return m.bsdf("mixturebsdf", {{"weights", weights}}, children);
    };
    const Vec3 wo = direction(40, 0);
    ComponentArena arena;
    const Bsdf bsdf = m.make(mixed(127, "conductor")).bsdf(plane_point(wo), arena);
    const auto sampled = bsdf.sample(wo, 0.9f, {0.5f, 0.5f}, TransportMode::Radiance);
    ASSERT_TRUE(sampled && sampled->is_delta);
    const auto again = bsdf.sample_delta(wo, sampled->event, TransportMode::Radiance);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->pdf, sampled->pdf);
    EXPECT_THROW(m.make(mixed(128, "conductor")), SceneError);
    EXPECT_NO_THROW(m.make(mixed(300, "diffuse")));
    const auto blend = [&](const char* second) {
        const int a = mixed(100, "diffuse"), b = mixed(20, second), c = mixed(20, "diffuse");
        const int inner = m.bsdf("blendbsdf", {{"weight", 0.5}}, {{"", b}, {"", c}});
        m.make("blendbsdf", {{"weight", 0.5}},
               {{"", a}, {"", m.bsdf("mask", {{"opacity", 0.5}}, {{"", inner}})}});
    };
    EXPECT_NO_THROW(blend("diffuse"));
    EXPECT_THROW(blend("dielectric"), SceneError);
}

}  // namespace
}  // namespace etendue
