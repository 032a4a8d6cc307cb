// Weights of specular connections and of the hits that make the same paths, against the definition in path_pdfs.h.

#include "manifold/specular_connection.h"

#include <array>
#include <numeric>

#include <gtest/gtest.h>

#include "pathspace/path_pdfs.h"
#include "random_guide.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr int kPixels = 16;

struct SpecularCase {
    const char* name;
    std::string xml;
};
void PrintTo(const SpecularCase& c, std::ostream* out) {
    *out << c.name;
}

std::vector<SpecularCase> weight_cases() {
    using namespace test;
    const std::string front = front_camera(kPixels) + room();
    return {
        {"lantern", lantern_room(front_camera(kPixels))},
        {"glass_ball", front + area_lamp() + sphere("0,-0.2,0.1", "0.45", kGlass)},
        {"mirror_and_gloss", front + area_lamp() +
                                 sphere("-0.4,-0.5,0", "0.45", "<bsdf type=\"conductor\"/>") +
                                 sphere("0.5,-0.5,0.2", "0.3", kPlastic)},
        {"environment",
         front + sphere("0,-0.2,0.1", "0.45", kGlass) + "<emitter type=\"constant\"/>"},
        {"normal_map",
         front + area_lamp() + sphere("0,-0.2,0.1", "0.45", normal_mapped(kGlass, "0.2", "2"))},
        {"bump_map", front + area_lamp() +
                         sphere("0,-0.2,0.1", "0.45", bump_mapped(kGlass, "0.02", "2")) +
                         sphere("-0.6,-0.6,0.1", "0.3",
                                bump_mapped("<bsdf type=\"conductor\"/>", "0.02", "2"))},
        {"mirrored_instance",
         front + area_lamp() + "<shape type=\"shapegroup\" id=\"g\">" +
             sphere("0,-0.2,0.1", "0.45", kGlass) +
             "</shape><shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">"
             "<scale x=\"-1\"/></transform></shape>"},
        {"several",
         front + area_lamp() + sphere("0,-0.2,0.1", "0.45", kGlass) +
             sphere("0.1,-0.2,0.1", "0.1",
                    "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>")},
    };
}

/// Next events select emitters as it wants; walks are not guided.
Guide guide_of_lights(const Scene& scene) {
    Guide guide;
    guide.lights = test::random_guide(scene, 5, 3).lights;
    return guide;
}

/// Solid angle of directions at `from` over the area normal to the rays at the lamp, from differences.
double jacobian_of_differences(const Scene& scene, const Vertex& from, Vec3d w,
                               const ChainEvents& events, const LampPoint& lamp) {
    constexpr double kStep = 1e-6;
    RenderStats stats;
    ChainTracer tracer(scene, from, stats);
    if (!tracer.follow(w, events)) return 0;
    const Vec3d d = tracer.ray().d;
    const TangentBasis first(w), last(d);
    // Where rays cross the plane through the point, normal to the ray through it; at infinity their directions.
    const auto crossing = [&](Vec3d along) {
        tracer.follow(normalize(w + along * kStep), events);
        const ChainRay& r = tracer.ray();
        if (lamp.is_infinite()) return r.d;
        return r.o + r.d * (dot(Vec3d(lamp.p) - r.o, d) / dot(r.d, d));
    };
    const Vec3d a = (crossing(first.s) - crossing(-first.s)) / (2 * kStep),
                b = (crossing(first.t) - crossing(-first.t)) / (2 * kStep);
    return 1 / std::fabs(dot(a, last.s) * dot(b, last.t) - dot(a, last.t) * dot(b, last.s));
}

/// What makes paths beside specular connections, hits and next events.
enum class Beside { Nothing, Connections, Gathers };

class SpecularWeights : public ::testing::TestWithParam<std::tuple<SpecularCase, Beside>> {};

TEST_P(SpecularWeights, AreThoseOfTheDefinition) {
    const auto& [test_case, beside_it] = GetParam();
    const bool has_connections = beside_it != Beside::Nothing;
    const Scene scene = test::build(test_case.xml);
    const Guide guide = guide_of_lights(scene);
    TechniqueCounts counts{.hit = 1, .next_event = 1, .guide = &guide, .specular_depth = 4};
    if (has_connections) counts.connect = 1, counts.splat = kPixels * kPixels;
    if (beside_it == Beside::Gathers) {
        counts.gather = kPixels * kPixels;
        counts.pairs = {.disc = 0.05f, .inner_disc = 0.02f, .min_edges = 3};
    }
    const Film film(scene.film(), scene.filter());
    Workspace work;
    work.is_observed = true;
    const WalkContext walk{scene, counts, work.stats, {6, 10}};
    Sampler sampler(SamplerKind::Independent, 5);
    int compared = 0;
    for (uint32_t pass = 0; pass < 40; ++pass)
        for (uint64_t pixel = 0; pixel < uint64_t(kPixels * kPixels); ++pixel) {
            sampler.start(pass, pixel);
            trace_eye_path(walk, film, pixel, sampler, work.z);
            for (int t = 2; t <= work.z.size(); ++t) {
                const auto x = join_specular(scene, work.z, t, {20}, sampler, counts, work);
                if (!x) continue;
                const int k = x->technique.s - 1;
                // The same path as a hit.
                SubPath z;
                start_eye_path_of_pixel(walk, film, pixel, sampler, z);
                while (z.size() < t) ASSERT_TRUE(extend<TransportMode::Radiance>(walk, sampler, z));
                const Vec3 w = normalize(x->b.p - z[t - 1].p);
                const BsdfEval f = z[t - 1].eval(w, TransportMode::Radiance);
                BsdfSample s{.wi = w, .weight = f.f / f.pdf, .pdf = f.pdf, .pdf_rev = f.pdf_rev};
                ChainEvents events;
                bool arrives = true;
                for (int i = 0; i <= k && arrives; ++i) {
                    arrives = append<TransportMode::Radiance>(walk, sampler, s, z);
                    if (!arrives || i == k) break;
                    events.add(work.pair[k - i].event);
                    const auto event = z[z.size() - 1].bsdf.sample_delta(
                        z[z.size() - 1].wo, work.pair[k - i].event, TransportMode::Radiance);
                    arrives = event.has_value();
                    if (arrives) s = *event, close<TransportMode::Radiance>(walk, z);
                }
                // Rays that end at an edge may miss the lamp.
                if (!arrives ||
                    (!z[z.size() - 1].is_infinite && z[z.size() - 1].emitter != x->emitter))
                    continue;
                close<TransportMode::Radiance>(walk, z);
                const auto hit = join_hit(z, z.size(), *x->emitter, counts);
                if (!hit) continue;

                std::vector<const Vertex*> vertices;
                for (int i = z.size() - 1; i >= 0; --i) vertices.push_back(&z[i]);
                // x_0 of the definition has its emitter.
                Vertex x0 = *vertices.front();
                x0.emitter = x->emitter;
                vertices.front() = &x0;
                std::vector<bool> delta;
                for (const Vertex* v : vertices) delta.push_back(v->is_delta);
                delta.front() = false;
                PathPdfs pdfs = evaluate_path(scene, vertices, delta, &guide).pdfs;
                const EmitterHit e =
                    x0.is_infinite
                        ? x->emitter->eval_infinite(x0.p)
                        : x->emitter->eval_surface(x0.ng, x0.uv, x0.location.prim, x0.wo);
                const LampPoint lamp{.emitter = x->emitter,
                                     .p = x0.p,
                                     .ng = x0.ng,
                                     .uv = x0.uv,
                                     .prim = x0.location.prim,
                                     .pdf = 1};
                const double J = jacobian_of_differences(scene, z[t - 1], Vec3d(w), events, lamp),
                             cosine = x0.is_infinite ? 1 : double(abs_dot(x0.ng, x0.wo));
                double way = 1;
                if (!x0.is_infinite) {
                    way = 0;
                    for (int i = t; i < z.size(); ++i) way += double(length(z[i].p - z[i - 1].p));
                }
                const double pmf = double(next_event_pmf(z[t - 1], *x->emitter, &guide));
                pdfs.specular_ratio = kSolutionShare * spread(J, way) * pmf * double(e.pdf_y0) /
                                      (double(f.pdf) * J * cosine);
                const double of_x = mis_weight(pdfs, x->technique, counts),
                             of_hit = mis_weight(pdfs, {Strategy::Hit, 0, z.size()}, counts);
                const float beside = hit_beside_specular(scene, z, z.size(), *x->emitter, counts);
                EXPECT_NEAR(double(x->mis_weight), of_x, 2e-3);
                EXPECT_NEAR(double(hit->mis_weight * beside), of_hit, 2e-3);
                EXPECT_NEAR(of_x + of_hit, 1, 1e-6) << "nothing else makes the path";
                ++compared;
            }
        }
    EXPECT_GT(compared, has_connections ? 3 : 50);
}

std::string case_name(const ::testing::TestParamInfo<std::tuple<SpecularCase, Beside>>& p) {
    constexpr const char* kNames[] = {"", "_beside_connections", "_beside_gathers"};
    return std::string(std::get<0>(p.param).name) + kNames[int(std::get<1>(p.param))];
}

INSTANTIATE_TEST_SUITE_P(Scenes, SpecularWeights,
                         ::testing::Combine(::testing::ValuesIn(weight_cases()),
                                            ::testing::Values(Beside::Nothing, Beside::Connections,
                                                              Beside::Gathers)),
                         case_name);

/// A point light between two mirrors, and photons that have come by way of the left one alone.
TEST(SpecularSeeds, FindChainsThatNoPhotonHasTaken) {
    const std::string mirror = "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>";
    const Scene scene = test::build(
        test::front_camera(kPixels) +
        test::rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>",
                        test::diffuse("0.5,0.5,0.5")) +
        test::rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>", mirror) +
        test::rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"1\"/>", mirror) +
        "<emitter type=\"point\"><point name=\"position\" value=\"0,0.3,0\"/></emitter>");
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .specular_depth = 1};
    const Film film(scene.film(), scene.filter());
    Workspace work;
    const WalkContext walk{scene, counts, work.stats, {3, 10}};
    Sampler sampler(SamplerKind::Independent, 5);
    double with = 0, without = 0;
    for (uint64_t i = 0; i < 40 * kPixels * kPixels; ++i) {
        sampler.start(0, i);
        trace_eye_path(walk, film, i % (kPixels * kPixels), sampler, work.z);
        if (work.z.size() < 2 || !work.z[1].is_connectible) continue;
        // Toward the image of the light in the left mirror.
        const Vertex& z1 = work.z[1];
        const Vec3 image{-2, 0.3f, 0};
        const Vec3 left = z1.p + (image - z1.p) * ((-1 - z1.p.x) / (image.x - z1.p.x));
        const SeedPhotons photons(std::vector<SeedPhoton>(
            8, {.p = z1.p, .n = side_normal(z1), .left = left, .emitter = 0}));
        for (const SeedPhotons* p : {&photons, static_cast<const SeedPhotons*>(nullptr)}) {
            const SpecularLimits limits{.max_depth = 20, .photons = p};
            const auto x = join_specular(scene, work.z, 2, limits, sampler, counts, work);
            if (x) (p ? with : without) += double(luminance(x->contribution));
        }
    }
    EXPECT_GT(without, 0);
    EXPECT_NEAR(with / without, 1, 0.1);
}

/// So that a sample with many trials is replayed with the same ones, whatever roulette there was.
TEST(SpecularTrials, DoNotDependOnRoulette) {
    const Scene scene = test::build(test::lantern_room(test::front_camera(kPixels)));
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .specular_depth = 4};
    const Film film(scene.film(), scene.filter());
    Workspace work;
    const WalkContext walk{scene, counts, work.stats, {6, 10}};
    Sampler sampler(SamplerKind::Independent, 5);
    int compared = 0, ended = 0;
    for (uint64_t i = 0; i < 80 * kPixels * kPixels; ++i) {
        sampler.start(0, i);
        trace_eye_path(walk, film, i % (kPixels * kPixels), sampler, work.z);
        for (int t = 2; t <= work.z.size(); ++t) {
            std::array<uint64_t, 2> trials{};
            std::array<bool, 2> found{};
            for (const size_t k : {0, 1}) {
                const uint64_t before = work.stats.chain_trials;
                const SpecularLimits limits{.max_depth = 20, .threshold = k == 0 ? 0.0f : 1.0f};
                found[k] =
                    join_specular(scene, work.z, t, limits, sampler, counts, work).has_value();
                trials[k] = work.stats.chain_trials - before;
            }
            ended += found[0] && !found[1];
            if (!found[0] || !found[1]) continue;
            EXPECT_EQ(trials[0], trials[1]);
            ++compared;
        }
    }
    EXPECT_GT(compared, 20);
    EXPECT_GT(ended, 20) << "nothing was subject to roulette";
    const auto& by_trials = work.stats.chains_by_trials;
    EXPECT_EQ(std::accumulate(by_trials.begin(), by_trials.end(), uint64_t(0)), work.stats.chains);
    EXPECT_LE(work.stats.chains + work.stats.chain_failures,
              work.stats.chain_seeds - work.stats.chain_trials);
}

/// A contribution with so many trials would be a very bright pixel, which says nothing.
TEST(SpecularTrials, OfSearchesThatAreGivenUpContributeNothing) {
    const Scene scene = test::build(test::lantern_room(test::front_camera(kPixels)));
    const TechniqueCounts counts{.hit = 1, .next_event = 1, .specular_depth = 4};
    const Film film(scene.film(), scene.filter());
    Workspace work;
    const WalkContext walk{scene, counts, work.stats, {6, 10}};
    Sampler sampler(SamplerKind::Independent, 5);
    constexpr uint64_t kMost = 2;
    uint64_t given_up = 0;
    int found = 0;
    for (uint64_t i = 0; i < 40 * kPixels * kPixels; ++i) {
        sampler.start(0, i);
        trace_eye_path(walk, film, i % (kPixels * kPixels), sampler, work.z);
        for (int t = 2; t <= work.z.size(); ++t) {
            const uint64_t before = work.stats.chain_trials;
            if (!join_specular(scene, work.z, t, {20}, sampler, counts, work)) continue;
            const uint64_t trials = work.stats.chain_trials - before;
            given_up += trials > kMost;
            const auto x = join_specular(scene, work.z, t, {.max_depth = 20, .most_trials = kMost},
                                         sampler, counts, work);
            EXPECT_EQ(x.has_value(), trials <= kMost);
            found += x.has_value();
            EXPECT_EQ(work.stats.runaways, given_up);
            // As in pilots.
            EXPECT_TRUE(join_specular(scene, work.z, t,
                                      {.max_depth = 20, .most_trials = kMost, .gives_up = false},
                                      sampler, counts, work));
        }
    }
    EXPECT_GT(found, 20);
    EXPECT_GT(given_up, 20u);
}

/// A lamp below water, and a weaker one that is selected far more often by what is learned.
std::string pool_with_lamps(const std::string& shape) {
    const auto lamp = [&](const char* x, const char* radiance) {
        return test::sphere(std::string(x) + ",-0.8,0", "0.1",
                            std::string("<emitter type=\"area\"><rgb name=\"radiance\" value=\"") +
                                radiance + "\"/></emitter>");
    };
    return shape + test::room() + lamp("-0.5", "9,9,9") + lamp("0.5", "1,1,1") +
           test::rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-0.5\"/>", test::kGlass);
}

/// Each emitter contributes as much in the mean, with whatever probability it is drawn.
TEST(SpecularConnections, AreUnbiasedWithAnySelectionOfLamps) {
    const Scene scene = test::build(pool_with_lamps(test::front_camera(kPixels)));
    // The weak lamp is selected nearly always.
    std::vector<Arrival> arrivals;
    for (int i = 0; i < 1000; ++i)
        for (const Vec3 n : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}})
            for (const Vec3 side : {n, -n}) arrivals.push_back({{{}, side, 1}, 1});
    Guide guide;
    guide.lights = LightSelections(
        arrivals, {scene.emitters()[0]->selection_pmf, scene.emitters()[1]->selection_pmf});
    const Film film(scene.film(), scene.filter());
    Workspace work;
    Sampler sampler(SamplerKind::Independent, 5);
    constexpr uint64_t kWalks = 200 * kPixels * kPixels;
    std::array<double, 2> mean{}, error{};
    for (const size_t k : {0, 1}) {
        // Without weights of hits: connections make all of the light.
        const TechniqueCounts counts{
            .next_event = 1, .guide = k == 1 ? &guide : nullptr, .specular_depth = 4};
        const WalkContext walk{scene, counts, work.stats, {4, 10}};
        double sum = 0, squares = 0;
        for (uint64_t i = 0; i < kWalks; ++i) {
            sampler.start(uint32_t(k), i);
            trace_eye_path(walk, film, i % (kPixels * kPixels), sampler, work.z);
            double value = 0;
            if (work.z.size() > 1)
                if (const auto x = join_specular(scene, work.z, 2, {20}, sampler, counts, work);
                    x && x->emitter == scene.emitters()[0].get())
                    value = std::fmin(double(luminance(x->contribution)), 100.0);
            sum += value, squares += value * value;
        }
        mean[k] = sum / kWalks;
        error[k] = std::sqrt((squares / kWalks - sqr(mean[k])) / kWalks);
    }
    for (const size_t k : {0, 1}) EXPECT_GT(mean[k], 5 * error[k]);
    EXPECT_NEAR(mean[0], mean[1], 4 * std::hypot(error[0], error[1]));
}

/// w / (1 - w) of a weight w of connections beside hits is in proportion to the square of the density of y_0.
TEST(SpecularWeightsOfLensHits, KnowTheSelectionOfTheEyeVertex) {
    const Scene scene = test::build(pool_with_lamps(test::lens_camera(kPixels)));
    const Guide guide = guide_of_lights(scene);
    TechniqueCounts counts{.hit = 1,
                           .next_event = 1,
                           .connect = 1,
                           .splat = kPixels * kPixels,
                           .hit_lens = kPixels * kPixels,
                           .specular_depth = 4};
    Workspace work;
    const WalkContext walk{scene, counts, work.stats, {6, 10}};
    Sampler sampler(SamplerKind::Independent, 5);
    int compared = 0;
    for (uint64_t i = 0; i < 4000; ++i) {
        sampler.start(0, i);
        trace_light_path(walk, sampler, work.y);
        for (int s = 2; s < work.y.size(); ++s) {
            const auto ratio = [&](const Guide* by) {
                counts.guide = by;
                const double rest = double(hit_lens_beside_specular(scene, work.y, s + 1, counts));
                return std::sqrt((1 - rest) / rest);
            };
            const double by_power = ratio(nullptr), learned = ratio(&guide);
            if (!(by_power > 0.05 && by_power < 20 && learned > 0.05 && learned < 20)) continue;
            int from = 1;
            while (work.y[from].is_delta) ++from;
            const Emitter& emitter = *work.y[0].emitter;
            EXPECT_NEAR(learned / by_power,
                        double(next_event_pmf(work.y[from], emitter, &guide)) /
                            double(emitter.selection_pmf),
                        0.02 * learned / by_power);
            ++compared;
        }
    }
    EXPECT_GT(compared, 50);
}

/// Light of a point that no specular connection can make is all left to hits of the lens.
TEST(SpecularWeightsOfLensHits, AreOneBehindBumps) {
    const std::string bumped =
        "<bsdf type=\"bumpmap\"><texture type=\"checkerboard\"><transform "
        "name=\"to_uv\"><scale value=\"3\"/></transform></texture><float name=\"scale\" "
        "value=\"0.2\"/>" +
        test::kGlass + "</bsdf>";
    const Scene scene = test::build(
        test::lens_camera(kPixels) + test::room() + test::sphere("0,0.3,0.1", "0.45", bumped) +
        test::rectangle("<translate z=\"-0.98\"/>",
                        "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>") +
        "<emitter type=\"point\"><point name=\"position\" value=\"0,0.3,0.1\"/></emitter>");
    const TechniqueCounts counts{.hit = 1,
                                 .next_event = 1,
                                 .connect = 1,
                                 .splat = kPixels * kPixels,
                                 .hit_lens = kPixels * kPixels,
                                 .specular_depth = 4};
    Workspace work;
    const WalkContext walk{scene, counts, work.stats, {6, 10}};
    Sampler sampler(SamplerKind::Independent, 5);
    int chains = 0;
    for (uint64_t i = 0; i < 2000; ++i) {
        sampler.start(0, i);
        trace_light_path(walk, sampler, work.y);
        for (int s = 2; s < work.y.size(); ++s) {
            chains += work.y[1].is_delta && !work.y[s - 1].is_delta && work.y[s].is_delta;
            EXPECT_EQ(hit_lens_beside_specular(scene, work.y, s + 1, counts), 1);
        }
    }
    EXPECT_GT(chains, 50);
}

}  // namespace
}  // namespace etendue
