// The principled BSDF. False-alarm rate of the χ² tests of each TEST: 0.1 %.

#include "bsdf/principled.h"

#include "bsdf/fresnel.h"
#include "bsdf/roughdielectric.h"
#include "lobe_tests.h"
#include "test_materials.h"

namespace etendue {
namespace {

using namespace etendue::testing;

PrincipledLobe opaque() {
    return {.base_color = Rgb(0.8f, 0.4f, 0.2f),
            .surface_roughness = 0.5f,
            .anisotropic = 0,
            .metallic = 0,
            .spec_trans = 0,
            .eta = 1.5f,
            .spec_tint = 0,
            .sheen = 0,
            .sheen_tint = 0,
            .flatness = 0,
            .clearcoat = 0,
            .clearcoat_gloss = 0};
}
PrincipledLobe metal() {
    PrincipledLobe lobe = opaque();
    lobe.metallic = 0.75f;
    lobe.surface_roughness = 0.2f;
    lobe.anisotropic = 0.8f;
    return lobe;
}
PrincipledLobe cloth() {
    PrincipledLobe lobe = opaque();
    lobe.sheen = 1;
    lobe.sheen_tint = 0.5f;
    lobe.flatness = 0.7f;
    lobe.spec_tint = 0.6f;
    return lobe;
}
PrincipledLobe car_paint() {
    PrincipledLobe lobe = metal();
    lobe.surface_roughness = 0.6f;
    lobe.clearcoat = 1;
    lobe.clearcoat_gloss = 0.5f;
    return lobe;
}
PrincipledLobe glass() {
    PrincipledLobe lobe = opaque();
    lobe.spec_trans = 1;
    lobe.surface_roughness = 0.4f;
    return lobe;
}
/// Without dielectric reflection.
PrincipledLobe dull() {
    PrincipledLobe lobe = opaque();
    lobe.eta = 1;
    return lobe;
}
PrincipledLobe dull_coat() {
    PrincipledLobe lobe = car_paint();
    lobe.metallic = 0;
    lobe.eta = 1;
    return lobe;
}
/// Everything at once.
PrincipledLobe mixed() {
    PrincipledLobe lobe = cloth();
    lobe.spec_trans = 0.6f;
    lobe.metallic = 0.3f;
    lobe.clearcoat = 0.8f;
    lobe.anisotropic = 0.4f;
    return lobe;
}

struct Named {
    const char* name;
    PrincipledLobe lobe;
};
std::vector<Named> all_lobes() {
    return {{"opaque", opaque()},       {"metal", metal()},        {"cloth", cloth()},
            {"car paint", car_paint()}, {"glass", glass()},        {"mixed", mixed()},
            {"dull", dull()},           {"dull coat", dull_coat()}};
}

TEST(Principled, SamplesMatchPdf) {
    const std::vector<Vec3> directions = {direction(0, 0), direction(60, 130), direction(85, -70),
                                          direction(120, 20)};
    const double significance = sidak(1e-3, int(2 * all_lobes().size() * directions.size()));
    for (const auto& [name, lobe] : all_lobes())
        for (Vec3 wo : directions) {
            SCOPED_TRACE(name);
            expect_samples_match_pdf(lobe, wo, significance, 30000);
        }
}

TEST(Principled, ValueDensityAndWeightAgree) {
    for (const auto& [name, lobe] : all_lobes()) {
        SCOPED_TRACE(name);
        for (Vec3 wo : test_directions_both_sides()) {
            expect_sample_agrees_with_eval(lobe, wo);
            expect_adjoint_symmetry(lobe, wo);
        }
        expect_finite(lobe);
    }
}

TEST(Principled, GlassIsARoughDielectric) {
    const PrincipledLobe lobe = glass();
    const RoughDielectricLobe reference{Microfacet(Microfacet::Kind::Ggx, 0.16f, 0.16f), 1.5f,
                                        Rgb(1), sqrt(lobe.base_color)};
    LobeRandom random(7);
    for (Vec3 wo : test_directions_both_sides())
        for (int i = 0; i < 500; ++i) {
            const Vec3 wi = sample_uniform_sphere(random.next_2d());
            const BsdfEval a = lobe.eval(wo, wi), b = reference.eval(wo, wi);
            EXPECT_TRUE(nearly(a.f, b.f, 1e-3, 1e-6))
                << describe(wo) << describe(wi) << a.f.g << " " << b.f.g;
            EXPECT_TRUE(nearly(a.pdf, b.pdf, 1e-3, 1e-6))
                << describe(wo) << describe(wi) << a.pdf << " " << b.pdf;
        }
}

// At wo = wi = n all Schlick weights vanish: f = base (1 − metallic)/π + F0 D/4 + clearcoat 0.04
// D_c/4.
TEST(Principled, HasTheClosedFormValueAtNormalIncidence) {
    const Vec3 n{0, 0, 1};
    PrincipledLobe lobe = opaque();
    lobe.metallic = 0.25f;
    lobe.clearcoat = 0.5f;
    const float alpha = 0.25f, D = 1 / (kPi * sqr(alpha)), cc2 = sqr(0.1f);
    const float D_coat = (1 - cc2) / (kPi * -std::log(cc2) * cc2);
    for (int c = 0; c < 3; ++c) {
        const float base = lobe.base_color[c], F0 = 0.75f * 0.04f + 0.25f * base;
        EXPECT_NEAR(lobe.eval(n, n).f[c],
                    0.75f * base / kPi + F0 * D / 4 + 0.5f * 0.04f * D_coat / 4, 1e-4f);
    }
}

// As in KHR_materials_specular: F0 = R0 · weight · color, of which the luminance counts.
TEST(Principled, ReflectanceMayBeGiven) {
    const Vec3 n{0, 0, 1};
    TestMaterials m;
    const auto f = [&](const std::vector<TestMaterials::Value>& values) {
        ComponentArena arena;
        const Material& material = m.make("principled", values);
        return material.bsdf(plane_point(n), arena).eval(n, n, TransportMode::Radiance).f;
    };
    const float D_4 = 1 / (4 * kPi * sqr(sqr(0.5f)));
    const TestMaterials::Value base{"base_color", Rgb(0.8f, 0.4f, 0.2f)},
        weight{"specular_weight", 0.5}, color{"specular_color", Rgb(0, 10, 5)},
        black{"specular_color", Rgb(0)}, mirror{"eta", 1000.0};
    const Rgb diffuse = Rgb(0.8f, 0.4f, 0.2f) * kInvPi;
    const auto expect = [&](const Rgb& found, const Rgb& F0) {
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], diffuse[c] + F0[c] * D_4, 2e-5f);
    };
    expect(f({base}), Rgb(0.04f));
    expect(f({base, weight}), Rgb(0.02f));
    expect(f({base, weight, color}), Rgb(0.02f * luminance(Rgb(0, 10, 5))));
    // What converters write for a material without specular part.
    expect(f({base, mirror, black}), Rgb(0));
    expect(f({base, mirror}), Rgb(sqr(999.0f / 1001)));
    // Glass has an index of refraction with the same reflectance.
    ComponentArena arena;
    const Material& clear =
        m.make("principled", {{"spec_trans", 1.0}, {"eta", 1.5}, {"specular_weight", 0.25}});
    const Bsdf bsdf = clear.bsdf(plane_point(n), arena);
    const auto& lobe = std::get<PrincipledLobe>(bsdf.front().lobe);
    EXPECT_NEAR(sqr((lobe.eta - 1) / (lobe.eta + 1)), 0.01f, 1e-6f);
}

// What converters to glTF write for a diffuse material: an index of 1000 without specular colour. The diffuse part of
// roughness 1 sends back more than an ideal one: along the normal n it reflects ∫ 2 c (1 + (c + 1/2) (1 - c)⁵) dc = 1 + 1/28
// of the base colour, c being the cosine of the other direction [Burley 2012, §5.3].
TEST(Principled, WithoutSpecularColorIsDiffuse) {
    const Vec3 n{0, 0, 1};
    const Rgb base(0.2f, 0.6f, 0.3f);
    TestMaterials m;
    ComponentArena arena;
    const Material& material = m.make(
        "principled",
        {{"base_color", base}, {"roughness", 1.0}, {"eta", 1000.0}, {"specular_color", Rgb(0)}});
    const Bsdf bsdf = material.bsdf(plane_point(n), arena);
    constexpr int kSteps = 4000;
    Rgb albedo;
    for (int i = 0; i < kSteps; ++i) {
        const float c = (float(i) + 0.5f) / kSteps;
        const Vec3 wi{std::sqrt(1 - sqr(c)), 0, c};
        albedo +=
            bsdf.eval(n, wi, TransportMode::Radiance).f * (2 * kPi / kSteps);  // times the cosine
    }
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(albedo[c], base[c] * (1 + 1 / 28.0f), 1e-4f);
}

// α along ∂p/∂u is the larger one [Burley 2012, §5.4].
TEST(Principled, AnisotropyStretchesHighlightsAlongU) {
    PrincipledLobe lobe = opaque();
    lobe.metallic = 1;
    lobe.anisotropic = 1;
    const float aspect = std::sqrt(0.1f);
    const Microfacet expected(Microfacet::Kind::Ggx, 0.25f / aspect, 0.25f * aspect);
    for (Vec3 wi : {direction(40, 0), direction(40, 90), direction(20, 30)})
        EXPECT_NEAR(lobe.eval({0, 0, 1}, wi).pdf, expected.D(normalize(wi + Vec3{0, 0, 1})) / 4,
                    1e-4f);
}

// At mirror directions m = n. Below the surface the reflection is that of the dielectric alone.
TEST(Principled, BlendsTheFresnelTermsOfMetalTintAndDielectric) {
    const Vec3 w = direction(75, 20);
    PrincipledLobe lobe = opaque();
    lobe.base_color = Rgb(0.9f, 0.3f, 0.6f);
    lobe.metallic = 0.4f;
    lobe.spec_tint = 0.7f;
    lobe.spec_trans = 1;
    const Microfacet main(Microfacet::Kind::Ggx, 0.25f, 0.25f);
    const float common = main.D({0, 0, 1}) * w.z / (4 * sqr(main.sigma(w)));
    const float schlick = std::pow(1 - w.z, 5.0f), F = fresnel_dielectric(w.z, lobe.eta).R;
    for (int c = 0; c < 3; ++c) {
        const float tint = 0.04f * lobe.base_color[c] / luminance(lobe.base_color);
        const float expected = 0.4f * lerp(schlick, lobe.base_color[c], 1) +
                               0.6f * 0.7f * lerp(schlick, tint, 1) + 0.6f * 0.3f * F;
        EXPECT_NEAR(lobe.eval(w, reflect(w)).f[c], expected * common, 1e-4f);
    }
    const float F_inside = fresnel_dielectric(-w.z, lobe.eta).R;
    EXPECT_NEAR(lobe.eval(-w, -reflect(w)).f.g, 0.6f * F_inside * common, 1e-4f);
}

TEST(Principled, RetroreflectionFlatnessAndSheenFollowBurley) {
    const Vec3 w = direction(75, 0);
    const auto diffuse_at = [&](PrincipledLobe lobe) {
        const PrincipledLobe black = [&] {
            PrincipledLobe b = lobe;
            b.base_color = Rgb(0);
            b.sheen = 0;
            return b;
        }();
        return (lobe.eval(w, w).f.g - black.eval(w, w).f.g) / w.z;
    };
    const float schlick = std::pow(1 - w.z, 5.0f), retro = 2 * 0.5f, base = 0.4f;
    const float burley =
        sqr(1 - 0.5f * schlick) + retro * (2 * schlick + sqr(schlick) * (retro - 1));
    EXPECT_NEAR(diffuse_at(opaque()), base / kPi * burley, 1e-4f);

    PrincipledLobe flat = opaque();
    flat.flatness = 1;
    const float Fss = sqr(lerp(schlick, 1, 0.5f * retro));
    EXPECT_NEAR(diffuse_at(flat), base / kPi * 1.25f * (Fss * (1 / (2 * w.z) - 0.5f) + 0.5f),
                1e-4f);

    // Sheen is one at grazing half angles only: cos(wo·m) = cos 75° for mirror directions.
    PrincipledLobe plain = opaque();
    plain.metallic = 0.25f;
    PrincipledLobe sheen = plain;
    sheen.sheen = 0.5f;
    sheen.sheen_tint = 0.6f;
    const float hue = lerp(0.6f, 1, base / luminance(sheen.base_color));
    EXPECT_NEAR((sheen.eval(w, reflect(w)).f.g - plain.eval(w, reflect(w)).f.g) / w.z,
                0.5f * 0.75f * schlick * hue, 1e-4f);
}

TEST(Principled, ExceedsUnitAlbedoByNoMoreThanBurleys) {
    for (const auto& [name, lobe] : all_lobes())
        for (Vec3 wo : test_directions_both_sides()) {
            PrincipledLobe white = lobe;
            white.base_color = Rgb(1);
            const Rgb albedo = sampled_albedo(white, wo, 64).value;
            // Diffuse white under an uncompensated specular lobe, at grazing angles with sheen and
            // clearcoat on top.
            const bool has_sheen = lobe.sheen > 0;
            EXPECT_LE(albedo.max(), has_sheen ? 1.7f : 1.35f) << name << " " << describe(wo);
            if (lobe.spec_trans == 1) {
                expect_energy_conserved(white, wo);
            }
        }
}

TEST(Principled, MaterialReadsItsParameters) {
    TestMaterials m;
    EXPECT_FALSE(m.make("principled").is_transmissive());
    EXPECT_TRUE(m.make("principled", {{"spec_trans", 0.5}}).is_transmissive());
    EXPECT_THROW(m.make("principled", {{"eta", 1.5}, {"specular", 0.5}}), SceneError);
    EXPECT_THROW(m.make("principled", {{"roughness", 1.5}}), SceneError);

    const auto lobe = [&](const Material& material) {
        ComponentArena arena;
        return std::get<PrincipledLobe>(material.bsdf(plane_point({0, 0, 1}), arena).front().lobe);
    };
    EXPECT_NEAR(lobe(m.make("principled")).eta, 1.5f, 1e-6f);  // F0 = 0.04
    EXPECT_EQ(lobe(m.make("principled", {{"eta", 1.8}})).eta, 1.8f);
    EXPECT_GT(lobe(m.make("principled", {{"specular", 0.0}, {"spec_trans", 1.0}})).eta, 1);
    // The sharpest lobe counts.
    EXPECT_FLOAT_EQ(opaque().roughness(), 0.25f);
    EXPECT_FLOAT_EQ(car_paint().roughness(), lerp(0.5f, 0.1f, 0.001f));
}

}  // namespace
}  // namespace etendue
