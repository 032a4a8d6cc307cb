// Lobes in world space: transport modes, shading normals, mixtures. False-alarm rate of the χ²
// tests: 0.1 %.

#include "bsdf/bsdf.h"

#include "bsdf/material.h"
#include "lobe_tests.h"

namespace etendue {
namespace {

using namespace etendue::testing;
using Kind = Microfacet::Kind;

const DiffuseLobe kDiffuse{Rgb(0.7f, 0.5f, 0.2f)};
const RoughConductorLobe kMetal{Microfacet(Kind::Ggx, 0.3f, 0.15f), Rgb(0.2f), Rgb(3.9f), Rgb(1)};
const RoughDielectricLobe kGlass{Microfacet(Kind::Beckmann, 0.3f, 0.3f), 1.5f, Rgb(1), Rgb(0.9f)};
const DielectricLobe kSmoothGlass{1.5f, Rgb(1), Rgb(1)};

/// A Bsdf whose components it owns.
struct Mixture {
    std::vector<BsdfComponent> components;
    ComponentArena arena = {};

    Bsdf bsdf(Vec3 ng) {
        Bsdf made;
        ComponentList list(ng, Frame{}, true, arena, made);
        for (const BsdfComponent& c : components)
            std::visit([&](const auto& lobe) { list.add(c.frame, lobe, c.weight); }, c.lobe);
        return made;
    }
};

Vec3 tilted(Vec3 n, float amount, LobeRandom& random) {
    return normalize(n + sample_uniform_sphere(random.next_2d()) * amount);
}

/// The lobe alone, or all of them mixed, about normals tilted against `ng`.
std::vector<Mixture> random_mixtures(Vec3 ng, LobeRandom& random) {
    const auto frame = [&] { return Frame::from_normal(tilted(ng, 0.5f, random)); };
    std::vector<Mixture> mixtures;
    mixtures.push_back({{{frame(), kDiffuse}}});
    mixtures.push_back({{{frame(), kMetal}}});
    mixtures.push_back({{{frame(), kGlass}}});
    mixtures.push_back(
        {{{frame(), kGlass, 0.5f}, {frame(), kDiffuse, 0.2f}, {frame(), kMetal, 0.3f}}});
    return mixtures;
}

TEST(Bsdf, RadianceAndImportanceAreAdjoint) {
    // f̃ is one function of the two directions, whichever end the walk comes from [Veach 1997,
    // §5.3].
    LobeRandom random(21);
    int values = 0, refractions = 0;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 ng = sample_uniform_sphere(random.next_2d());
        for (Mixture& mixture : random_mixtures(ng, random)) {
            const Bsdf bsdf = mixture.bsdf(ng);
            const Vec3 wo = sample_uniform_sphere(random.next_2d()),
                       wi = sample_uniform_sphere(random.next_2d());
            const BsdfEval radiance = bsdf.eval(wo, wi, TransportMode::Radiance);
            const BsdfEval importance = bsdf.eval(wi, wo, TransportMode::Importance);
            const double a = radiance.f.g / abs_dot(wi, ng), b = importance.f.g / abs_dot(wo, ng);
            ASSERT_TRUE(nearly(a, b, 2e-3, 1e-5))
                << a << " " << b << " " << describe(wo) << describe(wi);
            ASSERT_TRUE(nearly(radiance.pdf, importance.pdf_rev, 2e-3, 1e-5));
            ASSERT_TRUE(nearly(radiance.pdf_rev, importance.pdf, 2e-3, 1e-5));
            values += a > 0;
            refractions += a > 0 && dot(wo, ng) * dot(wi, ng) < 0;
        }
    }
    EXPECT_GT(values, 1000);
    EXPECT_GT(refractions, 200);
}

TEST(Bsdf, RadianceOfAnUntiltedRefractionLosesEtaSquared) {
    const Vec3 wo = direction(30, 0), wi = direction(160, 180);
    Mixture mixture{{{Frame{}, kGlass}}};
    const Bsdf bsdf = mixture.bsdf({0, 0, 1});
    const Rgb f = kGlass.eval(wo, wi).f;
    EXPECT_TRUE(nearly(bsdf.eval(wo, wi, TransportMode::Importance).f, f, 1e-6, 0));
    EXPECT_TRUE(nearly(bsdf.eval(wo, wi, TransportMode::Radiance).f, f / 2.25f, 1e-6, 0));
    EXPECT_TRUE(nearly(bsdf.eval(wi, wo, TransportMode::Radiance).f, kGlass.eval(wi, wo).f * 2.25f,
                       1e-6, 0));
}

TEST(Bsdf, NothingCrossesBetweenTheSidesOfTheTwoNormals) {
    const Vec3 ng{0, 0, 1};
    for (const Lobe& lobe : {Lobe(kDiffuse), Lobe(kGlass), Lobe(kSmoothGlass)}) {
        Mixture mixture{{{Frame::from_normal(direction(50, 0)), lobe}}};
        const Bsdf bsdf = mixture.bsdf(ng);
        const Vec3 good = direction(20, 0), bad = direction(80, 180);  // bad: above ng, below ns
        for (TransportMode mode : {TransportMode::Radiance, TransportMode::Importance}) {
            EXPECT_TRUE(bsdf.eval(good, bad, mode).f.is_zero());
            EXPECT_TRUE(bsdf.eval(bad, good, mode).f.is_zero());
            EXPECT_EQ(bsdf.eval(good, bad, mode).pdf, 0);
            EXPECT_FALSE(bsdf.sample(bad, 0.5f, {0.5f, 0.5f}, mode));
            LobeRandom random(22);
            for (int i = 0; i < 200; ++i) {
                const float u = random.next();
                if (const auto s = bsdf.sample(good, u, random.next_2d(), mode)) {
                    EXPECT_GT(dot(s->wi, ng) * dot(s->wi, bsdf.shading_normal()), 0);
                }
            }
        }
    }
}

TEST(Bsdf, DeltaSamplesAreCorrectedLikeValues) {
    const Vec3 ng{0, 0, 1}, ns = direction(25, 40);
    Mixture mixture{{{Frame::from_normal(ns), kSmoothGlass}}};
    const Bsdf bsdf = mixture.bsdf(ng);
    for (Vec3 wo : {direction(30, 0), direction(150, 90)}) {
        for (float u_lobe : {0.0f, kOneMinusEpsilon}) {
            const auto radiance = bsdf.sample(wo, u_lobe, {}, TransportMode::Radiance);
            const auto importance = bsdf.sample(wo, u_lobe, {}, TransportMode::Importance);
            ASSERT_TRUE(radiance && importance && radiance->is_delta);
            const Vec3 wi = radiance->wi;
            EXPECT_FLOAT_EQ(radiance->weight.g, 1 / sqr(radiance->eta));
            EXPECT_NEAR(importance->weight.g,
                        abs_dot(wo, ns) * abs_dot(wi, ng) / (abs_dot(wo, ng) * abs_dot(wi, ns)),
                        1e-5);
        }
    }
}

/// A Bsdf about the z axis seen as a lobe, for the lobes' tests.
struct AsLobe {
    Bsdf bsdf;
    TransportMode mode;

    BsdfEval eval(Vec3 wo, Vec3 wi) const { return bsdf.eval(wo, wi, mode); }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const {
        return bsdf.sample(wo, u_lobe, u, mode);
    }
    float max_pdf(Vec3 wo, const DirectionCone& c) const { return bsdf.max_pdf(wo, c); }
    float roughness() const { return bsdf.roughness(); }
    Rgb albedo_estimate() const { return bsdf.albedo_estimate(); }
};

TEST(Bsdf, MixturesSampleTheirDensity) {
    LobeRandom random(23);
    const auto directions = test_directions_both_sides();
    const double significance = sidak(1e-3, int(2 * 4 * directions.size()));
    for (Mixture& mixture : random_mixtures({0, 0, 1}, random)) {
        for (Vec3 wo : directions) {
            expect_samples_match_pdf(AsLobe{mixture.bsdf({0, 0, 1}), TransportMode::Radiance}, wo,
                                     significance, 30000);
            for (TransportMode mode : {TransportMode::Radiance, TransportMode::Importance})
                expect_sample_agrees_with_eval(AsLobe{mixture.bsdf({0, 0, 1}), mode}, wo, 3e-3,
                                               500);
        }
        expect_finite(AsLobe{mixture.bsdf({0, 0, 1}), TransportMode::Radiance});
    }
}

TEST(Bsdf, MixtureWithDeltaLobeSharesItsProbability) {
    const ConductorLobe mirror{Rgb(0), Rgb(1), Rgb(0.8f)};
    Mixture mixture{
        {{Frame{}, kDiffuse, 0.25f}, {Frame{}, mirror, 0.5f}, {Frame{}, kMetal, 0.25f}}};
    const Bsdf bsdf = mixture.bsdf({0, 0, 1});
    const Vec3 wo = direction(40, 10);
    EXPECT_TRUE(bsdf.has_smooth() && bsdf.has_delta());
    EXPECT_EQ(bsdf.roughness(), 0.15f);
    LobeRandom random(24);
    int deltas = 0;
    Rgb sum;
    const int n = 40000;
    for (int i = 0; i < n; ++i) {
        const auto s =
            bsdf.sample(wo, (float(i) + 0.5f) / n, random.next_2d(), TransportMode::Radiance);
        if (!s) continue;
        sum += s->weight;
        if (!s->is_delta) continue;
        ++deltas;
        ASSERT_EQ(s->wi, reflect(wo));
        ASSERT_EQ(s->pdf, 0.5f);
        ASSERT_EQ(s->pdf_rev, 0.5f);
        ASSERT_FLOAT_EQ(s->weight.g, 0.8f);
    }
    EXPECT_EQ(deltas, n / 2);
    // The smooth density is the smooth lobes' share, 0.5, never renormalised.
    double integral = integrate_2d(
        [&](double z, double phi) {
            const float r = float(std::sqrt(1 - z * z));
            return double(bsdf.eval(wo,
                                    {r * float(std::cos(phi)), r * float(std::sin(phi)), float(z)},
                                    TransportMode::Radiance)
                              .pdf);
        },
        0, 1, 0, 2 * M_PI, 1e-5, 4);
    EXPECT_LE(integral, 0.5 + 1e-4);
    EXPECT_GT(integral, 0.47);
    // Albedos add by weight.
    const double expected = 0.25 * 0.5 + 0.5 * 0.8 + 0.25 * sampled_albedo(kMetal, wo).value.g;
    EXPECT_NEAR(sum.g / n, expected, 5e-3);
}

TEST(Bsdf, EmptyBsdfScattersNothing) {
    const Bsdf bsdf;
    EXPECT_TRUE(bsdf.eval({0, 0, 1}, {0, 0, 1}, TransportMode::Radiance).f.is_zero());
    EXPECT_FALSE(bsdf.sample({0, 0, 1}, 0.5f, {0.5f, 0.5f}, TransportMode::Radiance));
}

}  // namespace
}  // namespace etendue
