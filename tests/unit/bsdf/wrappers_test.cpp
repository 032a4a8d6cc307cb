// Materials made of other materials. False-alarm rate of the χ² tests of each TEST: 0.1 %.

#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

/// A material at a point of the plane z = 0, with the interface of a lobe. The local frame is the
/// world's.
struct WrappedLobe {
    const Material* material;
    TransportMode mode = TransportMode::Importance;
    Vec2 uv{0.5f, 0.5f};

    BsdfEval eval(Vec3 wo, Vec3 wi) const {
        ComponentArena arena;
        return bsdf(wo, arena).eval(wo, wi, mode);
    }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const {
        ComponentArena arena;
        return bsdf(wo, arena).sample(wo, u_lobe, u, mode);
    }
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        ComponentArena arena;
        return bsdf(wo, arena).max_pdf(wo, c);
    }
    Bsdf bsdf(Vec3 wo, ComponentArena& arena) const {
        return material->bsdf(plane_point(wo, uv), arena);
    }
    Vec3 shading_normal(Vec3 wo) const {
        ComponentArena arena;
        return bsdf(wo, arena).shading_normal();
    }
};

/// What the two ends of a path see of a vertex: f̃ |wi·ng| of radiance from wo is, up to the
/// cosines, that of importance from wi, with the densities exchanged.
void expect_both_ends_agree(const Material& material, Vec2 uv = {0.5f, 0.5f}) {
    const WrappedLobe from_eye{&material, TransportMode::Radiance, uv};
    const WrappedLobe from_light{&material, TransportMode::Importance, uv};
    LobeRandom random(11);
    int count = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 wo = sample_uniform_sphere(random.next_2d()),
                   wi = sample_uniform_sphere(random.next_2d());
        const BsdfEval a = from_eye.eval(wo, wi), b = from_light.eval(wi, wo);
        ASSERT_TRUE(nearly(a.f * std::fabs(wo.z), b.f * std::fabs(wi.z), 1e-3, 1e-6))
            << describe(wo) << describe(wi);
        ASSERT_TRUE(nearly(a.pdf, b.pdf_rev, 1e-3, 1e-6) && nearly(a.pdf_rev, b.pdf, 1e-3, 1e-6));
        count += !a.f.is_zero();
    }
    EXPECT_GT(count, 200);
}

void expect_orthonormal(const Frame& f) {
    EXPECT_NEAR(length(f.s), 1, 1e-5);
    EXPECT_NEAR(length(f.n), 1, 1e-5);
    EXPECT_NEAR(dot(f.s, f.n), 0, 1e-5);
    EXPECT_NEAR(length(cross(f.n, f.s) - f.t), 0, 1e-5);
}

void expect_near(Vec3 a, Vec3 b) {
    EXPECT_LT(length(a - b), 1e-5f) << describe(a) << " " << describe(b);
}

std::vector<TestMaterials::Value> reflectance(Rgb c) {
    return {{"reflectance", c}};
}

// ---- twosided

TEST(TwoSided, LooksTheSameFromBothSides) {
    TestMaterials m;
    const int plastic = m.bsdf("roughplastic", {{"alpha", 0.2}});
    const Material& two_sided = m.make("twosided", {}, {{"", plastic}});
    const WrappedLobe lobe{&two_sided}, one_sided{&m.make(plastic)};
    EXPECT_TRUE(two_sided.is_two_sided());
    EXPECT_FALSE(two_sided.is_transmissive());
    LobeRandom random(12);
    for (Vec3 wo : test_directions())
        for (int i = 0; i < 100; ++i) {
            const Vec3 wi = sample_uniform_sphere(random.next_2d());
            const BsdfEval front = lobe.eval(wo, wi);
            EXPECT_EQ(front.f, one_sided.eval(wo, wi).f);
            const BsdfEval back = lobe.eval({wo.x, wo.y, -wo.z}, {wi.x, wi.y, -wi.z});
            EXPECT_TRUE(nearly(front.f, back.f, 1e-5, 1e-7));
            EXPECT_TRUE(nearly(front.pdf, back.pdf, 1e-5, 1e-7));
        }
    const double significance = sidak(1e-3, 4);
    for (Vec3 wo : {direction(40, 30), direction(140, 30)})
        expect_samples_match_pdf(lobe, wo, significance, 20000);
    expect_both_ends_agree(two_sided);
}

TEST(TwoSided, PutsTwoMaterialsOnTwoSides) {
    TestMaterials m;
    const int red = m.bsdf("diffuse", reflectance({1, 0, 0})),
              blue = m.bsdf("diffuse", reflectance({0, 0, 1}));
    const Material& material = m.make("twosided", {}, {{"", red}, {"", blue}});
    const WrappedLobe lobe{&material};
    EXPECT_EQ(lobe.sample(direction(30, 0), 0.5f, {0.3f, 0.3f})->weight, Rgb(1, 0, 0));
    EXPECT_EQ(lobe.sample(direction(150, 0), 0.5f, {0.3f, 0.3f})->weight, Rgb(0, 0, 1));
    EXPECT_LT(lobe.sample(direction(150, 0), 0.5f, {0.3f, 0.3f})->wi.z, 0);
    EXPECT_TRUE(lobe.eval(direction(30, 0), direction(150, 0)).f.is_zero());
    EXPECT_EQ(material.mean_albedo(), Rgb(0.5f, 0, 0.5f));

    // Within another one the inner material sees its front only.
    const int inner = m.bsdf("twosided", {}, {{"", red}, {"", blue}});
    const WrappedLobe outer{&m.make("twosided", {}, {{"", inner}})};
    EXPECT_EQ(outer.sample(direction(150, 0), 0.5f, {0.3f, 0.3f})->weight, Rgb(1, 0, 0));
}

TEST(TwoSided, UsesTheGeometricSide) {
    TestMaterials m;
    const Material& material = m.make("twosided", {}, {{"", m.bsdf("diffuse")}});
    const Vec3 wo = direction(80, 0);
    SurfacePoint point = plane_point(wo);
    point.ns = direction(30, 180);  // 110° from wo, which is in front of the surface
    ComponentArena arena;
    const Bsdf bsdf = material.bsdf(point, arena);
    EXPECT_EQ(bsdf.shading_normal(), point.ns);
    EXPECT_FALSE(bsdf.sample(wo, 0.5f, {0.5f, 0.5f}, TransportMode::Radiance));
}

TEST(TwoSided, RefusesWhatLetsLightPass) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse"), glass = m.bsdf("dielectric");
    const int mask = m.bsdf("mask", {}, {{"", diffuse}});
    EXPECT_THROW(m.make("twosided", {}, {{"", glass}}), SceneError);
    EXPECT_THROW(m.make("twosided", {}, {{"", diffuse}, {"", glass}}), SceneError);
    EXPECT_THROW(m.make("twosided", {}, {{"", mask}}), SceneError);
    EXPECT_THROW(m.make("twosided"), SceneError);
    EXPECT_THROW(m.make("twosided", {}, {{"", diffuse}, {"", diffuse}, {"", diffuse}}), SceneError);
}

// ---- mask, null

TEST(Mask, HasItsOpacityAndDoesNotScaleTheNestedMaterial) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse", reflectance(Rgb(0.8f)));
    FunctionTexture ramp;
    ramp.color = [](Vec2 uv) { return Rgb(2 * uv.x); };
    const Material& material = m.make("mask", {}, {{"opacity", m.texture(ramp)}, {"", diffuse}});
    EXPECT_FLOAT_EQ(material.opacity({0.25f, 0}), 0.5f);
    EXPECT_EQ(material.opacity({0.75f, 0}), 1);  // not 1.5
    EXPECT_FALSE(material.is_opaque());
    EXPECT_EQ(WrappedLobe{&material}.sample(direction(30, 0), 0.5f, {0.3f, 0.3f})->weight,
              Rgb(0.8f));

    EXPECT_FLOAT_EQ(m.make("mask", {}, {{"", diffuse}}).opacity(Vec2()), 0.5f);
    EXPECT_TRUE(m.make("mask", {{"opacity", 1.0}}, {{"", diffuse}}).is_opaque());
    const int inner = m.bsdf("mask", {{"opacity", 0.5}}, {{"", diffuse}});
    const Material& outer = m.make("mask", {{"opacity", 0.4}}, {{"", inner}});
    EXPECT_FLOAT_EQ(outer.opacity(Vec2()), 0.2f);
    EXPECT_FALSE(outer.is_opaque());
    EXPECT_FALSE(m.make("mask", {{"opacity", 1.0}}, {{"", inner}}).is_opaque());
    EXPECT_THROW(m.make("mask"), SceneError);
    EXPECT_THROW(m.make("mask", {{"opacity", 1.5}}, {{"", diffuse}}), SceneError);
}

TEST(Null, IsNeverMet) {
    TestMaterials m;
    const Material& material = m.make("null");
    EXPECT_EQ(material.opacity(Vec2()), 0);
    EXPECT_FALSE(material.is_opaque());
    EXPECT_FALSE(material.may_be_smooth());
    const WrappedLobe lobe{&material};
    EXPECT_TRUE(lobe.eval(direction(30, 0), direction(30, 90)).f.is_zero());
    EXPECT_FALSE(lobe.sample(direction(30, 0), 0.5f, {0.5f, 0.5f}));
}

// ---- blendbsdf

TEST(BlendBsdf, IsTheWeightedSumOfItsMaterials) {
    TestMaterials m;
    const int a = m.bsdf("diffuse", reflectance({0.9f, 0.5f, 0.1f}));
    const int b = m.bsdf("roughplastic", {{"alpha", 0.1}});
    const int c = m.bsdf("phong", {{"exponent", 50.0}});
    const int bc = m.bsdf("blendbsdf", {{"weight", 0.25}}, {{"", b}, {"", c}});
    const Material& blend = m.make("blendbsdf", {{"weight", 0.4}}, {{"", a}, {"", bc}});
    const WrappedLobe lobe{&blend};
    const std::pair<float, WrappedLobe> parts[] = {
        {0.6f, {&m.make(a)}}, {0.3f, {&m.make(b)}}, {0.1f, {&m.make(c)}}};
    LobeRandom random(13);
    for (Vec3 wo : test_directions())
        for (int i = 0; i < 200; ++i) {
            const Vec3 wi = sample_uniform_sphere(random.next_2d());
            Rgb f;
            float pdf = 0;
            for (const auto& [w, part] : parts) {
                f += part.eval(wo, wi).f * w;
                pdf += part.eval(wo, wi).pdf * w;
            }
            EXPECT_TRUE(nearly(lobe.eval(wo, wi).f, f, 1e-5, 1e-7));
            EXPECT_TRUE(nearly(lobe.eval(wo, wi).pdf, pdf, 1e-5, 1e-7));
        }
    const double significance = sidak(1e-3, int(2 * test_directions().size()));
    for (Vec3 wo : test_directions()) {
        expect_samples_match_pdf(lobe, wo, significance, 20000);
        expect_sample_agrees_with_eval(lobe, wo);
        expect_adjoint_symmetry(lobe, wo);
    }
    EXPECT_TRUE(nearly(blend.mean_albedo().r,
                       0.6 * 0.9 + 0.3 * m.make(b).mean_albedo().r + 0.1 * 0.7, 1e-5, 0));
}

TEST(BlendBsdf, BlendsOneSidedTwoSidedAndTransmissiveMaterials) {
    TestMaterials m;
    const int dust = m.bsdf("twosided", {}, {{"", m.bsdf("diffuse", reflectance(Rgb(0.6f)))}});
    const int glass = m.bsdf("roughdielectric", {{"alpha", 0.3}});
    const Material& blend = m.make("blendbsdf", {{"weight", 0.5}}, {{"", dust}, {"", glass}});
    EXPECT_TRUE(blend.is_transmissive());
    const WrappedLobe lobe{&blend}, only_glass{&m.make(glass)};
    // From behind, the frame of the two-sided half is turned and that of the glass is not.
    const Vec3 wo = direction(150, 0), through = direction(40, 180);
    EXPECT_FALSE(only_glass.eval(wo, through).f.is_zero());
    EXPECT_TRUE(nearly(lobe.eval(wo, through).f, only_glass.eval(wo, through).f * 0.5f, 1e-5, 0));
    const double significance = sidak(1e-3, 4);
    for (Vec3 w : {wo, direction(30, 0)}) expect_samples_match_pdf(lobe, w, significance, 20000);
}

TEST(BlendBsdf, SharesOpacity) {
    TestMaterials m;
    const int white = m.bsdf("diffuse", reflectance(Rgb(1))),
              black = m.bsdf("diffuse", reflectance(Rgb(0)));
    const int half = m.bsdf("mask", {{"opacity", 0.5}}, {{"", white}});
    const Material& blend = m.make("blendbsdf", {{"weight", 0.2}}, {{"", half}, {"", black}});
    EXPECT_FLOAT_EQ(blend.opacity(Vec2()), 0.8f * 0.5f + 0.2f);
    EXPECT_FALSE(blend.is_opaque());
    // Of the light that meets the surface, 0.4 of 0.6 meets the white material.
    const Vec3 wo = direction(30, 0), wi = direction(40, 90);
    EXPECT_NEAR(WrappedLobe{&blend}.eval(wo, wi).f.g, wi.z / kPi * 0.4f / 0.6f, 1e-6f);

    const Material& with_null =
        m.make("blendbsdf", {{"weight", 1.0}}, {{"", white}, {"", m.bsdf("null")}});
    EXPECT_EQ(with_null.opacity(Vec2()), 0);
    EXPECT_FALSE(WrappedLobe{&with_null}.sample(wo, 0.5f, {0.5f, 0.5f}));
}

TEST(BlendBsdf, ParametersAreChecked) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse");
    EXPECT_THROW(m.make("blendbsdf", {}, {{"", diffuse}, {"", diffuse}}), SceneError);
    EXPECT_THROW(m.make("blendbsdf", {{"weight", 0.5}}, {{"", diffuse}}), SceneError);
}

// ---- bumpmap, normalmap

/// The plane bumped with the slope (a, b) against (u, v).
const Material& bumped(TestMaterials& m, Vec2 slope, int nested, double scale = 1) {
    FunctionTexture heights;
    heights.color = [](Vec2) { return Rgb(0.5f); };
    heights.slope = [slope](Vec2) { return slope; };
    return m.make("bumpmap", {{"scale", scale}}, {{"", nested}, {"", m.texture(heights)}});
}
const Material& normal_mapped(TestMaterials& m, Vec3 n, int nested) {
    FunctionTexture normals;
    normals.color = [n](Vec2) { return Rgb(n.x, n.y, n.z) * 0.5f + Rgb(0.5f); };
    return m.make("normalmap", {}, {{"normalmap", m.texture(normals)}, {"", nested}});
}

TEST(BumpMap, HasTheNormalOfTheDisplacedSurface) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse");
    // z = 2 (0.3 x − 0.1 y)
    const WrappedLobe lobe{&bumped(m, {0.3f, -0.1f}, diffuse, 2)};
    expect_near(lobe.shading_normal({0, 0, 1}), normalize({-0.6f, 0.2f, 1}));

    // Tangents of another length, not at right angles: u and v run along (2, 0) and (1, 4), and h =
    // 0.3 u + 0.5 v.
    SurfacePoint point = plane_point({0, 0, 1});
    point.dpdu = {2, 0, 0};
    point.dpdv = {1, 4, 0};
    ComponentArena arena;
    const float slope_x = 0.3f / 2, slope_y = (0.5f - slope_x) / 4;
    const Material& skewed = bumped(m, {0.3f, 0.5f}, diffuse);
    expect_near(skewed.bsdf(point, arena).shading_normal(), normalize({-slope_x, -slope_y, 1}));
    // A mirrored parametrisation has the same bumps.
    std::swap(point.dpdu, point.dpdv);
    const Material& mirrored = bumped(m, {0.5f, 0.3f}, diffuse);
    expect_near(mirrored.bsdf(point, arena).shading_normal(), normalize({-slope_x, -slope_y, 1}));

    // Height alone moves no normal, an interpolated one neither.
    point.ns = direction(20, 70);
    expect_near(bumped(m, {0, 0}, diffuse).bsdf(point, arena).shading_normal(), point.ns);

    // The texture has two names and may have none.
    FunctionTexture slope;
    slope.slope = [](Vec2) { return Vec2{0.6f, -0.2f}; };
    for (const char* name : {"displacement", "arbitrary"}) {
        const WrappedLobe named{&m.make("bumpmap", {}, {{"", diffuse}, {name, m.texture(slope)}})};
        expect_near(named.shading_normal({0, 0, 1}), normalize({-0.6f, 0.2f, 1}));
    }

    // Without a parametrisation nothing changes.
    point.ns = {0, 0, 1};
    point.dpdu = point.dpdv = {};
    expect_near(skewed.bsdf(point, arena).shading_normal(), {0, 0, 1});
}

TEST(NormalMap, HasTheNormalOfTheTexture) {
    TestMaterials m;
    const Vec3 n = normalize({0.3f, -0.4f, 0.8f});
    const WrappedLobe lobe{&normal_mapped(m, n, m.bsdf("diffuse"))};
    expect_near(lobe.shading_normal({0, 0, 1}), n);
    expect_near(lobe.shading_normal({0, 0, -1}), n);
}

TEST(PerturbedFrame, IsOrthonormalAndOnTheSideOfTheSurface) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse");
    LobeRandom random(14);
    for (int i = 0; i < 500; ++i) {
        const float steep = 5 * random.next();
        const Vec3 n = sample_uniform_sphere(random.next_2d());
        const Material* materials[] = {
            &bumped(m, (random.next_2d() - Vec2{0.5f, 0.5f}) * steep, diffuse),
            &normal_mapped(m, n, diffuse)};
        SurfacePoint point = plane_point({0, 0, 1});
        point.ns = direction(70 * random.next(), 360 * random.next());
        for (const Material* material : materials) {
            ComponentArena arena;
            const Frame frame = material->bsdf(point, arena).front().frame;
            expect_orthonormal(frame);
            EXPECT_GT(frame.n.z, 0);
        }
    }
}

TEST(PerturbedFrame, TwoSidedWrapsInBothOrders) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse"), both = m.bsdf("twosided", {}, {{"", diffuse}});
    const Vec3 n = normalize({0.3f, -0.4f, 0.8f}), behind{0, 0, -1};
    FunctionTexture normals, heights;
    normals.color = [n](Vec2) { return Rgb(n.x, n.y, n.z) * 0.5f + Rgb(0.5f); };
    heights.color = [](Vec2) { return Rgb(0.5f); };
    heights.slope = [n](Vec2) { return Vec2{-n.x / n.z, -n.y / n.z}; };
    const int normal_map = m.texture(normals), bump_map = m.texture(heights);
    const auto normal_behind = [&](const Material& material) {
        return WrappedLobe{&material}.shading_normal(behind);
    };

    // Inside, the tilt is the same on both sides; outside, the whole normal is turned.
    const int mapped = m.bsdf("normalmap", {}, {{"normalmap", normal_map}, {"", diffuse}});
    const int bumped = m.bsdf("bumpmap", {}, {{"displacement", bump_map}, {"", diffuse}});
    expect_near(normal_behind(m.make("twosided", {}, {{"", mapped}})), {n.x, n.y, -n.z});
    expect_near(normal_behind(m.make("twosided", {}, {{"", bumped}})), {n.x, n.y, -n.z});
    expect_near(normal_behind(m.make("normalmap", {}, {{"normalmap", normal_map}, {"", both}})),
                -n);
    expect_near(normal_behind(m.make("bumpmap", {}, {{"displacement", bump_map}, {"", both}})), -n);
}

TEST(PerturbedFrame, BothEndsOfAPathAgree) {
    TestMaterials m;
    const int plastic = m.bsdf("roughplastic", {{"alpha", 0.3}}),
              glass = m.bsdf("roughdielectric", {{"alpha", 0.4}});
    const int both = m.bsdf("twosided", {}, {{"", plastic}});
    expect_both_ends_agree(bumped(m, {0.5f, -0.3f}, both));
    expect_both_ends_agree(bumped(m, {0.5f, -0.3f}, glass));
    expect_both_ends_agree(normal_mapped(m, {0.6f, 0, 0.8f}, both));
    // Samples lost below the surface are part of the density.
    const WrappedLobe lobe{&bumped(m, {0.5f, -0.3f}, both)};
    const double significance = sidak(1e-3, 4);
    for (Vec3 wo : {direction(50, 30), direction(130, 200)}) {
        expect_samples_match_pdf(lobe, wo, significance, 20000);
        expect_sample_agrees_with_eval(lobe, wo);
    }
}

TEST(PerturbedFrame, ParametersAreChecked) {
    TestMaterials m;
    const int diffuse = m.bsdf("diffuse");
    FunctionTexture grey;
    grey.color = [](Vec2) { return Rgb(0.5f); };
    const int texture = m.texture(grey);
    EXPECT_THROW(m.make("bumpmap", {}, {{"", diffuse}}), SceneError);
    EXPECT_THROW(m.make("bumpmap", {}, {{"", texture}}), SceneError);
    EXPECT_THROW(m.make("bumpmap", {}, {{"", texture}, {"displacement", texture}, {"", diffuse}}),
                 SceneError);
    EXPECT_THROW(
        m.make("bumpmap", {{"use_shadowing_function", true}}, {{"", texture}, {"", diffuse}}),
        SceneError);
    EXPECT_NO_THROW(
        m.make("bumpmap", {{"use_shadowing_function", false}}, {{"", texture}, {"", diffuse}}));
    EXPECT_THROW(m.make("normalmap", {}, {{"", diffuse}}), SceneError);
    EXPECT_THROW(m.make("normalmap", {{"flip_invalid_normals", true}},
                        {{"normalmap", texture}, {"", diffuse}}),
                 SceneError);
}

// ---- registry

TEST(MaterialRegistry, NamesAreUniqueAndEveryParameterIsDocumented) {
    std::vector<std::string> names;
    for (const MaterialEntry& entry : material_registry()) {
        EXPECT_STREQ(entry.info.category, "bsdf");
        EXPECT_EQ(std::count(names.begin(), names.end(), entry.info.name), 0) << entry.info.name;
        names.push_back(entry.info.name);
        EXPECT_TRUE(entry.make);
        EXPECT_TRUE(std::string(entry.info.doc).ends_with('.')) << entry.info.name;
        for (const ParamInfo& p : entry.info.params)
            EXPECT_TRUE(std::string(p.doc).ends_with('.')) << entry.info.name << " " << p.name;
    }
    EXPECT_EQ(names.size(), 23u);
}

}  // namespace
}  // namespace etendue
