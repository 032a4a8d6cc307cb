// Directions of guided vertices against their density. False-alarm rate: 0.1 % for each case.

#include <map>
#include <set>

#include <gtest/gtest.h>

#include "chi2.h"
#include "guide/guide.h"
#include "math/warp.h"
#include "modes.h"
#include "pathspace/walk.h"
#include "random.h"
#include "test_scenes.h"

namespace etendue {
namespace {

using testing::Random;

struct Case {
    const char* name;
    std::string bsdf;
};

std::vector<Case> cases() {
    const auto two_sided = [](const std::string& b) {
        return "<bsdf type=\"twosided\">" + b + "</bsdf>";
    };
    return {
        {"diffuse", test::diffuse("0.7,0.6,0.5")},
        {"plastic", two_sided(test::kPlastic)},
        {"rough_metal", test::kRoughMetal},
        {"rough_glass", test::kRoughGlass},
        {"mirror_and_diffuse",
         two_sided("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.4\"/><bsdf "
                   "type=\"diffuse\"/><bsdf type=\"conductor\"/></bsdf>")},
    };
}

/// Wide enough lobes for a quadrature.
Guide smooth_guide() {
    Random random(5);
    GuideCell cell;
    for (GuideCell::Field& field : cell.fields) {
        field.share = {0.3f, 0.6f, 0.8f};
        for (int k = 0; k < 5; ++k) {
            const Vec3 mean = random.unit_vector();
            field.mixture.add({mean, random.next_1d(), random.between(2, 25), random.next_1d()});
        }
    }
    Guide guide;
    guide.surfaces = GuideTree(cell);
    return guide;
}

class GuidedVertex : public ::testing::TestWithParam<Case> {
protected:
    GuidedVertex()
        : scene(test::build(test::front_camera(8) + test::area_lamp() +
                            test::sphere("0,0,0", "0.5", GetParam().bsdf))),
          film(scene.film(), scene.filter()), guide(smooth_guide()) {}

    /// z_1 on the sphere, seen by several pixels.
    void trace(SubPath& z, uint32_t index) {
        const TechniqueCounts counts{.hit = 1, .connect = 1, .guide = &guide};
        const WalkContext walk{scene, counts, stats, {2, 1000}};
        Sampler sampler(SamplerKind::Independent, 4);
        sampler.start(index, 0);
        start_eye_path(walk, film, 27 + 8 * (index % 2) + index / 2 % 2, sampler, z);
        ASSERT_EQ(z.size(), 2);
        ASSERT_NE(z[1].guide, nullptr);
    }

    Scene scene;
    Film film;
    Guide guide;
    RenderStats stats;
};

TEST_P(GuidedVertex, SamplesItsDensity) {
    for (uint32_t index = 0; index < 4; ++index) {
        SubPath z;
        trace(z, index);
        const Vertex& v = z[1];
        Random random(index);
        testing::Chi2Grid grid(-1, 1, 16, -M_PI, M_PI, 32);
        int delta = 0;
        constexpr int kSamples = 200000;
        for (int i = 0; i < kSamples; ++i) {
            const float u_lobe = random.next_1d(), u_guide = random.next_1d();
            const auto s = v.sample(u_lobe, random.next_2d(), u_guide, kEye);
            if (!s || s->is_delta) {
                delta += s.has_value();
                grid.add_outside();
                continue;
            }
            grid.add(double(s->wi.z), std::atan2(double(s->wi.y), double(s->wi.x)));
            const BsdfEval e = v.eval(s->wi, kEye);
            ASSERT_NEAR(s->pdf / e.pdf, 1, 1e-3);
            ASSERT_NEAR(s->weight.g * s->pdf, e.f.g, 1e-3 * std::fmax(1.0f, e.f.g));
            if (s->gain < 1e5f) {
                ASSERT_NEAR(s->gain, s->pdf / v.eval_unguided(s->wi, kEye).pdf, 2e-3 * s->gain);
            }
        }
        const auto result = grid.test(
            [&](double cos, double phi) {
                const double sin = std::sqrt(1 - cos * cos);
                return double(
                    v.eval({float(sin * std::cos(phi)), float(sin * std::sin(phi)), float(cos)},
                           kEye)
                        .pdf);
            },
            3);
        EXPECT_GT(result.p_value, 1e-3 / 4) << result.total_probability;
        const float P_delta = v.bsdf.delta_probability(v.wo, kEye);
        EXPECT_LE(result.total_probability + double(P_delta), 1.001);
        EXPECT_NEAR(double(delta) / kSamples, double(P_delta), 0.005);
    }
}

/// The density of the reverse direction is that of the other walk, which looks the guide up itself.
TEST_P(GuidedVertex, KnowsTheOtherWalk) {
    Random random(11);
    for (uint32_t index = 0; index < 20; ++index) {
        SubPath z;
        trace(z, index);
        const Vertex& v = z[1];
        int compared = 0;
        for (int i = 0; i < 200; ++i) {
            const Vec3 w = random.unit_vector();
            const BsdfEval e = v.eval(w, kEye);
            if (!(e.pdf_rev > 0)) continue;
            ++compared;
            Vertex back = v;
            back.wo = w;
            back.set_guide(guide.surfaces.cell(v.p), kLight, true);
            const BsdfEval r = back.eval(v.wo, kLight);
            EXPECT_NEAR(e.pdf_rev, r.pdf, 1e-4 * std::fmax(1.0f, r.pdf));
            EXPECT_NEAR(e.pdf, r.pdf_rev, 1e-4 * std::fmax(1.0f, e.pdf));
        }
        EXPECT_GT(compared, 20);
    }
}

TEST_P(GuidedVertex, IsBelowItsBound) {
    Random random(13);
    for (uint32_t index = 0; index < 10; ++index) {
        SubPath z;
        trace(z, index);
        for (int i = 0; i < 200; ++i) {
            const DirectionCone cone{random.unit_vector(), random.between(0.001f, 1)};
            const float bound = z[1].max_pdf(cone, kEye);
            for (int k = 0; k < 20; ++k) {
                const Vec3 w = Frame::from_normal(cone.axis).to_world(
                    sample_uniform_cone(random.next_2d(), 2 * sqr(std::sin(cone.angle / 2))));
                EXPECT_LE(z[1].eval(w, kEye).pdf, bound * 1.001f);
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Materials, GuidedVertex, ::testing::ValuesIn(cases()),
                         [](const auto& p) { return std::string(p.param.name); });

/// Directions at infinity from which light paths start, where the emitter has a density of its own.
TEST(GuidedOrigin, IsSampledByItsDensity) {
    const Scene scene =
        test::build(test::front_camera(8) + test::room() +
                    "<emitter type=\"sky\"><vector name=\"sun_direction\" x=\"0.3\" y=\"0.6\" "
                    "z=\"0.5\"/></emitter>");
    const Emitter& sky = *scene.infinite_emitters().front();
    Random random(6);
    Guide::AtInfinity learned{sky.index, {}};
    constexpr double kShare = 0.6;
    learned.fit.share.fill(float(kShare));
    for (int k = 0; k < 5; ++k)
        learned.fit.mixture.add({random.unit_vector(), 0, random.between(2, 25), 1});
    Guide guide;
    guide.add_at_infinity(learned);
    const TechniqueCounts counts{.hit = 1, .connect = 1, .guide = &guide};
    RenderStats stats;
    const WalkContext walk{scene, counts, stats, {2, 1000}};
    Sampler sampler(SamplerKind::Independent, 4);
    SubPath y;
    testing::Chi2Grid grid(-1, 1, 16, -M_PI, M_PI, 32);
    double flux = 0, unguided_flux = 0;
    constexpr uint32_t kPaths = 200000;
    uint32_t differing = 0;
    for (uint32_t i = 0; i < kPaths; ++i) {
        const auto arrives = [&] { return y.size() > 1 ? double(y[1].beta.g) / kPaths : 0.0; };
        sampler.start(i, 0);
        const bool starts = start_light_path(walk, sampler, y);
        flux += starts ? arrives() : 0;
        if (starts) {
            const Vec3 d = y[0].p;
            grid.add(double(d.z), std::atan2(double(d.y), double(d.x)));
            const float pdf = origin_pdf(&guide, sky, d, sky.eval_infinite(d).pdf_y0);
            differing += std::fabs(y[0].pdf_fwd / pdf - 1) > 1e-4f;
        } else {
            grid.add_outside();
        }
        const TechniqueCounts plain{.hit = 1, .connect = 1};
        if (start_light_path({scene, plain, stats, {2, 1000}}, sampler, y))
            unguided_flux += arrives();
    }
    const auto result = grid.test(
        [&](double cos, double phi) {
            const double sin = std::sqrt(1 - cos * cos);
            const Vec3 d{float(sin * std::cos(phi)), float(sin * std::sin(phi)), float(cos)};
            return double(origin_pdf(&guide, sky, d, sky.eval_infinite(d).pdf_y0));
        },
        3);
    EXPECT_GT(result.p_value, 1e-3) << result.total_probability;
    // The sky's density is that of a cell, and a few directions are rounded into the next one.
    EXPECT_LT(differing, kPaths / 10000);
    // Some of the guide's directions lie below the horizon; they start no path.
    EXPECT_GT(result.total_probability, 1.1 - kShare);
    EXPECT_LT(result.total_probability, 0.9);
    EXPECT_NEAR(flux / unguided_flux, 1, 0.02);
}

/// Light paths from one finite emitter, by a guide of emission.
class GuidedEmission : public ::testing::TestWithParam<Case> {
protected:
    /// All light paths reach the wall around.
    GuidedEmission()
        : scene(test::build(test::front_camera(8) +
                            test::sphere("0,0,0", "5", test::diffuse("0.5,0.5,0.5")) +
                            GetParam().bsdf)) {}

    const Emitter& emitter() const { return *scene.emitters().front(); }
    /// Starts light path `index` from y_0.
    bool start(uint32_t index) {
        const TechniqueCounts counts{.hit = 1, .connect = 1, .guide = &guide};
        sampler.start(index, 0);
        return start_light_path({scene, counts, stats, {2, 1000}}, sampler, y);
    }
    void set_guide(const GuideCell& cell) {
        guide.emission = GuideTree(cell);
        ASSERT_FALSE(emitter().is_infinite());
    }

    const Scene scene;
    Guide guide;
    Sampler sampler{SamplerKind::Independent, 4};
    RenderStats stats;
    SubPath y;
};

std::vector<Case> emitters() {
    // So small that the lobes look the same from all of a lamp.
    return {{"area", test::rectangle("<scale value=\"0.001\"/><rotate x=\"1\" angle=\"60\"/>",
                                     "<emitter type=\"area\"/>")},
            {"area_with_two_sides",
             test::rectangle("<scale value=\"0.001\"/><rotate x=\"1\" angle=\"70\"/>",
                             "<emitter type=\"area\"><boolean name=\"two_sided\" "
                             "value=\"true\"/></emitter>")},
            {"point",
             "<emitter type=\"point\"><point name=\"position\" value=\"0,0.6,0.3\"/></emitter>"},
            {"spot", "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"70\"/><transform "
                     "name=\"to_world\"><lookat origin=\"0,0.6,0.2\" target=\"0,-0.6,0\" "
                     "up=\"0,0,1\"/></transform></emitter>"}};
}

TEST_P(GuidedEmission, IsSampledByItsDensity) {
    Random random(5);
    GuideCell cell;
    cell.center = {0, 0.3f, 0};
    GuideCell::Field& field = cell.fields[size_t(kLight)];
    field.share.fill(0.7f);
    // With a parallax, and without one.
    for (int k = 0; k < 5; ++k)
        field.mixture.add({normalize(random.unit_vector() + Vec3{0, -0.7f, 0}), k % 2 ? 0.3f : 0.0f,
                           random.between(2, 25), random.next_1d()});
    set_guide(cell);
    testing::Chi2Grid grid(-1, 1, 16, -M_PI, M_PI, 32);
    constexpr uint32_t kPaths = 200000;
    Vec3 p, ng;
    Vec2 uv;
    double density_error = 0;
    for (uint32_t i = 0; i < kPaths; ++i) {
        if (!start(i) || y.size() < 2) {
            grid.add_outside();
            continue;
        }
        const Vec3 w = direction(y[0], y[1]);
        grid.add(double(w.z), std::atan2(double(w.y), double(w.x)));
        const float unguided = y[0].eval_unguided(w, kLight).pdf;
        const float pdf = emission_pdf(&guide, emitter(), y[0].p, y[0].ng, w, unguided);
        density_error =
            std::max(density_error, std::fabs(1 - double(to_area(pdf, y[0], y[1]) / y[1].pdf_fwd)));
        p = y[0].p, ng = y[0].ng, uv = y[0].uv;
    }
    EXPECT_LT(density_error, 2e-3);
    const auto result = grid.test(
        [&](double cos, double phi) {
            const double sin = std::sqrt(1 - cos * cos);
            const Vec3 w{float(sin * std::cos(phi)), float(sin * std::sin(phi)), float(cos)};
            const Vec3 n = emitter().is_area() ? ng : w;
            const float unguided = emitter().eval_emission(n, uv, 0, w).pdf_d;
            return double(emission_pdf(&guide, emitter(), p, n, w, unguided));
        },
        3);
    EXPECT_GT(result.p_value, 1e-3 / 4) << result.total_probability;
    EXPECT_GT(result.total_probability, 0.4);
}

INSTANTIATE_TEST_SUITE_P(Emitters, GuidedEmission, ::testing::ValuesIn(emitters()),
                         [](const auto& p) { return std::string(p.param.name); });

/// A box of lamps is one cell, with lobes on all sides; each of its faces emits on its own side only.
TEST(GuidedLamps, EmitOnTheirSide) {
    const std::string lamp = "<emitter type=\"area\"/>";
    const Scene scene =
        test::build(test::front_camera(8) + test::room() +
                    test::rectangle("<scale value=\"0.1\"/><rotate x=\"1\" angle=\"90\"/>", lamp) +
                    test::rectangle("<scale value=\"0.1\"/><rotate x=\"1\" angle=\"-90\"/>"
                                    "<translate y=\"0.1\"/>",
                                    lamp));
    GuideCell cell;
    cell.center = {0, 0.05f, 0};
    GuideCell::Field& field = cell.fields[size_t(kLight)];
    field.share.fill(0.9f);
    field.mixture.add({{0, 1, 0}, 0, 30, 1});
    field.mixture.add({{0, -1, 0}, 0, 30, 1});
    Guide guide;
    guide.emission = GuideTree(cell);
    const TechniqueCounts counts{.hit = 1, .connect = 1, .guide = &guide};
    Sampler sampler(SamplerKind::Independent, 4);
    RenderStats stats;
    SubPath y;
    int lost = 0;
    constexpr int kPaths = 10000;
    for (uint32_t i = 0; i < kPaths; ++i) {
        sampler.start(i, 0);
        ASSERT_TRUE(start_light_path({scene, counts, stats, {2, 1000}}, sampler, y));
        lost += !(y[0].guide && y.size() == 2);
    }
    // Some leave by the open front.
    EXPECT_LT(lost, kPaths / 50);
}

/// A guide that has learned nothing changes no bit of a walk.
TEST(UntrainedGuide, LeavesWalksAsTheyAre) {
    const Scene scene = test::build(test::mixed_room(test::front_camera(8)));
    const Film film(scene.film(), scene.filter());
    Guide guide;
    GuideCell cell;
    cell.fields[0].mixture.add({{0, 0, 1}, 0, 10, 1});
    guide.surfaces = guide.emission = GuideTree(cell);
    const TechniqueCounts without{.hit = 1, .connect = 1},
        with{.hit = 1, .connect = 1, .guide = &guide};
    RenderStats stats;
    SubPath a, b;
    for (uint32_t i = 0; i < 500; ++i) {
        Sampler sampler(SamplerKind::Independent, 1);
        sampler.start(i, i % 64);
        const WalkContext plain{scene, without, stats, {}}, guided{scene, with, stats, {}};
        const auto expect_same = [&] {
            ASSERT_EQ(a.size(), b.size());
            for (int k = 0; k < a.size(); ++k) {
                EXPECT_EQ(a[k].p, b[k].p);
                EXPECT_EQ(a[k].beta, b[k].beta);
                EXPECT_EQ(a[k].pdf_fwd, b[k].pdf_fwd);
                EXPECT_EQ(a[k].pdf_rev, b[k].pdf_rev);
                EXPECT_EQ(a[k].weight_sum, b[k].weight_sum);
            }
        };
        trace_light_path(plain, sampler, a);
        trace_light_path(guided, sampler, b);
        expect_same();
        trace_eye_path(plain, film, i % 64, sampler, a);
        trace_eye_path(guided, film, i % 64, sampler, b);
        expect_same();
    }
}

/// Records which numbers are read.
class ReadNumbers final : public PrimarySource {
public:
    uint32_t bits(Stream stream, uint64_t vertex, uint32_t slot) override {
        slots[{stream, vertex}].insert(slot);
        return uint32_t(hash_combine(uint64_t(stream) << 32 | vertex, slot) >> 32);
    }
    std::map<std::pair<Stream, uint64_t>, std::set<uint32_t>> slots;
};

/// The number that decides at masks is the last one of a vertex. Chains with a guide change it as those without.
TEST(GuidedWalk, DecidesAtMasksByTheSameNumberAsWithoutGuide) {
    const std::string veil = test::rectangle(
        "<scale value=\"0.1\"/>", "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.5\"/>" +
                                      test::diffuse("0.5") + "</bsdf>");
    const Scene scene =
        test::build(test::front_camera(8) + test::room() + test::area_lamp() + veil);
    ASSERT_TRUE(scene.has_masks());
    const Film film(scene.film(), scene.filter());
    Guide guide = smooth_guide();
    guide.emission = guide.surfaces;
    const auto last_slots = [&](const Guide* g) {
        const TechniqueCounts counts{.hit = 1, .connect = 1, .guide = g};
        RenderStats stats;
        const WalkContext walk{scene, counts, stats, {3, 1000}};
        ReadNumbers numbers;
        Sampler sampler(numbers);
        SubPath path;
        EXPECT_TRUE(start_light_path(walk, sampler, path));
        EXPECT_EQ(path[0].guide != nullptr, g != nullptr);
        start_eye_path(walk, film, 27, sampler, path);
        EXPECT_EQ(path.size(), 2);
        extend<kEye>(walk, sampler, path);
        EXPECT_EQ(path[1].guide != nullptr, g != nullptr);
        std::map<std::pair<Stream, uint64_t>, uint32_t> last;
        for (const auto& [block, slots] : numbers.slots) last[block] = *slots.rbegin();
        return last;
    };
    const auto without = last_slots(nullptr);
    EXPECT_EQ(without.size(), 3u);
    EXPECT_EQ(without, last_slots(&guide));
}

}  // namespace
}  // namespace etendue
