// Joins and weights against the slow definitions, on random paths of scenes with all kinds of events.

#include <map>

#include <gtest/gtest.h>

#include "path_ends.h"
#include "pathspace/path_pdfs.h"
#include "pathspace/point_grid.h"
#include "random.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr int kPixels = 8;

struct Case {
    const char* name;
    std::string xml;
};

std::vector<Case> cases() {
    using namespace test;
    const std::string spheres =
        sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) + sphere("0.4,-0.65,0.3", "0.3", kRoughGlass);
    return {
        {"mixed", mixed_room(front_camera(kPixels))},
        {"thinlens", mixed_room(lens_camera(kPixels))},
        {"orthographic", mixed_room(sensor("0,0,3.4", "0,0,0", kPixels, "", "", "orthographic"))},
        {"point",
         front_camera(kPixels) + room() + spheres +
             "<emitter type=\"point\"><point name=\"position\" value=\"0,0.7,0\"/></emitter>"},
        {"spot", front_camera(kPixels) + room() + spheres +
                     "<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"60\"/><transform "
                     "name=\"to_world\"><lookat origin=\"0,0.9,0\" target=\"0,0,0.01\" "
                     "up=\"1,0,0\"/></transform></emitter>"},
        {"thinlens_constant",
         lens_camera(kPixels) + room() + spheres + "<emitter type=\"constant\"/>"},
        {"orthographic_constant", sensor("0,0,3.4", "0,0,0", kPixels, "", "", "orthographic") +
                                      room() + spheres + "<emitter type=\"constant\"/>"},
        {"constant", front_camera(kPixels) + room() + spheres + "<emitter type=\"constant\"/>"},
        {"directional", front_camera(kPixels) + room() + spheres +
                            "<emitter type=\"directional\"><vector name=\"direction\" "
                            "value=\"0.2,-0.4,-1\"/></emitter>"},
        {"several",
         mixed_room(front_camera(kPixels)) +
             "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>" +
             "<emitter type=\"point\"><point name=\"position\" value=\"0,0.7,0.5\"/></emitter>"},
    };
}

/// What there is besides the connections of bidirectional path tracing; Variants: of the choices of gathers.
enum class Extra { None, Merges, Gathers, Variants, Stored };

class Joins : public ::testing::TestWithParam<std::tuple<Case, Extra>> {
protected:
    Joins()
        : scene(test::build(std::get<Case>(GetParam()).xml)), film(scene.film(), scene.filter()),
          sampler(SamplerKind::Independent, 7) {
        const float N = kPixels * kPixels;
        counts = {.hit = 1,
                  .next_event = 1,
                  .connect = 1,
                  .splat = N,
                  .hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f};
        if (extra() == Extra::Stored) {
            counts.connect = 5;
            counts.connect_emission = 3;
        } else if (extra() != Extra::None) {
            (extra() == Extra::Merges ? counts.merge : counts.gather) = N;
            // Large enough for the clamp of gathers to matter now and then.
            counts.disc = 0.3f;
            counts.min_pair_edges = extra() == Extra::Merges ? 2 : 3;
            if (extra() == Extra::Variants) {
                counts.pair_rule = PairRule::Both;
                counts.clamps_disc = false;
                counts.short_pair_rate = 0.3f;
                // Shares between 1 and about 1/20, from cell to cell.
                std::vector<PointGrid::Entry> points;
                testing::Random random(11);
                for (int i = 0; i < 12000; ++i) points.push_back({random.in_cube() * 2, 0});
                PointGrid grid;
                grid.build(points, 0.3f);
                density = PairDensity(grid, 0.3f);
                counts.density = &density;
            }
        }
    }

    static Extra extra() { return std::get<Extra>(GetParam()); }

    /// Both sub-paths of sample `index`, without roulette.
    void trace(uint32_t index) {
        sampler.start(index, index % (kPixels * kPixels));
        const WalkOptions walk{6, 1000};
        start_light_path(scene, sampler, counts, y, stats);
        if (y.size() > 0) check_hit_lens(1);
        for (int s = 2; s <= y.size(); ++s) {
            extend<TransportMode::Importance>(scene, sampler, walk, counts, y, stats);
            check_hit_lens(s);
        }
        start_eye_path(scene, film, index % (kPixels * kPixels), sampler, counts, z, stats);
        while (z.size() >= 2 &&
               extend<TransportMode::Radiance>(scene, sampler, walk, counts, z, stats)) {
        }
    }

    /// Compares a join with the path's own definition. End points of the join are connectible by any other event too.
    void check(const Join& join, const std::vector<const Vertex*>& x, double p_sampled) {
        const int n = int(x.size());
        std::vector<bool> delta(x.size(), false);
        for (int i = 0; i < n; ++i) {
            const bool is_end = i == join.technique.s - 1 || i == join.technique.s;
            delta[size_t(i)] = !is_end && x[size_t(i)]->is_delta;
        }
        for (bool d : delta)
            if (d) return;  // densities of delta events are checked by the weights' agreement below
        const PathValue value = evaluate_path(scene, x, delta);
        const double p = value.pdfs.density(join.technique);
        ASSERT_GT(p, 0);
        Tally& tally = tallies[join.technique.strategy];
        tally.add(p_sampled / p, 1);
        for (int c = 0; c < 3; ++c)
            if (value.f[c] > 0) tally.add(join.contribution[c] * p / value.f[c], 1);
        tally.add(join.mis_weight, mis_weight(value.pdfs, join.technique, counts));
        ++checked;
    }

    /// The last ray of y, which left y_{s-1}, where it meets the lens.
    void check_hit_lens(int s) {
        const auto j = join_hit_lens(scene, y, s, counts);
        if (!j || y[s - 1].is_delta) return;
        const Vertex& a = y[s - 1];
        const Vec3 o = a.is_infinite ? y.flight.o : a.p;
        const auto sample = scene.sensor().hit_lens(o, y.flight.d, kInf);
        Vertex lens;
        lens.kind = Vertex::Kind::Sensor;
        lens.p = sample->p;
        lens.ng = sample->ng;
        lens.pdf_fwd = sample->pdf_pos;
        SubPath none;
        std::vector<const Vertex*> x = path_vertices(y, s, none, 0);
        x.push_back(&lens);
        check(*j, x, density_of(y, s) * to_area(y.flight.pdf_sa, a, lens));
    }

    /// Any two vertices taken for a pair: contribution and weight are those of the path without the dropped one.
    void check_gather(int s, int t) {
        if (!y[s - 1].may_connect || !z[t - 1].may_connect) return;
        for (const bool eye : {true, false})
            if (drops(counts.pair_rule, eye, gloss(y[s - 2], y[s - 2].is_delta),
                      gloss(z[t - 2], z[t - 2].is_delta)))
                check_gather(s, t, eye);
    }
    void check_gather(int s, int t, bool drops_eye) {
        const auto j = join_gather(scene, y, s, z, t, drops_eye, counts);
        if (!j) return;
        const auto x = path_vertices(y, drops_eye ? s : s - 1, z, drops_eye ? t - 1 : t);
        const int n = int(x.size()), m = s - 1;
        for (int i = 0; i < n; ++i) {
            const bool is_end = drops_eye ? i == m || i == m + 1 : i == m || i == m - 1;
            if (!is_end && x[size_t(i)]->is_delta) return;
        }
        const PathValue value = evaluate_path(scene, x, std::vector<bool>(x.size(), false));
        const double p =
            density_of(y, drops_eye ? s : s - 1) * density_of(z, drops_eye ? t - 1 : t);
        Tally& tally = tallies[Strategy::Gather];
        for (int c = 0; c < 3; ++c)
            if (value.f[c] > 0) tally.add(j->contribution[c] * p / value.f[c], 1);
        tally.add(j->mis_weight, mis_weight(value.pdfs, j->technique, counts));
    }

    /// z_{t-1} as if the light path had found it too, from y_{s-2}: where the two coincide a merge is its definition.
    void check_merge(int s, int t) {
        const Vertex &b = z[t - 1], &from = y[s - 2];
        if (!b.may_connect || !from.may_connect) return;
        SubPath merged;
        for (int i = 0; i < s - 1; ++i) merged.append() = y[i];
        merged[s - 2].is_delta = false;
        Vertex& a = merged.append();
        a = b;
        a.wo = from.is_infinite ? from.p : normalize(from.p - b.p);
        if (s == 2) {
            const Emitter::Emission e = from.emitter->eval_emission(from.ng, from.uv, -a.wo);
            if (e.Le_cos.is_zero()) return;
            a.beta = from.beta * e.Le_cos / e.pdf_d;
            a.pdf_fwd = to_area(e.pdf_d, from, b);
            a.next_event_ratio = next_event_ratio(from, -a.wo);
            a.weight_sum = 0;
        } else {
            const BsdfEval f = from.bsdf.eval(from.wo, -a.wo, TransportMode::Importance);
            if (f.f.is_zero()) return;
            a.beta = from.beta * f.f / f.pdf;
            a.pdf_fwd = to_area(f.pdf, from, b);
            merged[s - 3].pdf_rev = f.pdf_rev * from.to_predecessor;
            a.weight_sum = level_sum<Side::Light>(merged, s - 3, merged[s - 2].weight_sum, counts);
        }
        a.to_predecessor = from.is_infinite ? 1.0f
                                            : (from.has_cosine ? abs_dot(from.ng, a.wo) : 1.0f) /
                                                  length2(from.p - a.p);
        const auto j = join_merge(merged, s, z, t, counts);
        if (!j) return;
        const auto x = path_vertices(merged, s, z, t - 1);
        for (size_t i = 0; i < x.size(); ++i)
            if (i != size_t(s - 1) && x[i]->is_delta) return;
        const PathValue value = evaluate_path(scene, x, std::vector<bool>(x.size(), false));
        const double p = density_of(merged, s) * density_of(z, t) * double(counts.disc);
        Tally& tally = tallies[Strategy::Merge];
        for (int c = 0; c < 3; ++c)
            if (value.f[c] > 0) tally.add(j->contribution[c] * p / value.f[c], 1);
        tally.add(j->mis_weight, mis_weight(value.pdfs, j->technique, counts));
        // The same flux without its path.
        const auto alone = join_photon({a.p, a.wo, a.beta, y[0].emitter, s}, z, t, counts.disc);
        EXPECT_EQ(alone->contribution.g, j->contribution.g);
    }

    /// Rays start a little off their surface, so on short edges the walk's directions differ from those between the stored
    /// points: a few comparisons deviate by more than rounding. A wrong factor makes all of its strategy deviate.
    struct Tally {
        int compared = 0, deviating = 0;
        void add(double fast, double slow) {
            ++compared;
            deviating += !(std::fabs(fast - slow) < 2e-3);
        }
    };

    static double density_of(const SubPath& path, int count) {
        double p = 1;
        for (int i = 0; i < count; ++i) p *= path[i].pdf_fwd;
        return p;
    }

    Scene scene;
    Film film;
    Sampler sampler;
    TechniqueCounts counts;
    PairDensity density;
    SubPath y, z;
    RenderStats stats;
    std::map<Strategy, Tally> tallies;
    int checked = 0;
};

TEST_P(Joins, EqualTheDefinition) {
    for (uint32_t index = 0; index < 2000 && !HasFatalFailure(); ++index) {
        trace(index);
        for (int s = extra() == Extra::Stored ? 1 : 2; s <= y.size(); ++s)
            for (int t = 2; t <= z.size(); ++t)
                if (const auto j = join_connect(scene, y, s, z, t, counts))
                    check(*j, path_vertices(y, s, z, t), density_of(y, s) * density_of(z, t));
        for (int s = 2; s <= y.size() && counts.gather > 0; ++s)
            for (int t = 2; t <= z.size(); ++t) check_gather(s, t);
        for (int s = 2; s <= y.size() && counts.merge > 0; ++s)
            for (int t = 2; t <= z.size(); ++t) check_merge(s, t);
        for (int t = 2; t <= z.size(); ++t)
            for_each_hit(scene, z, t, counts, [&](const Join& j) {
                Vertex x0 = z[t - 1];
                if (z[t - 1].is_infinite) x0.emitter = scene.infinite_emitters().front();
                if (z[t - 1].is_infinite && scene.infinite_emitters().size() > 1) return;
                auto x = path_vertices(y, 0, z, t);
                x[0] = &x0;
                check(j, x, density_of(z, t));
            });
        for (int t = 2; t <= z.size(); ++t) {
            if (z[t - 1].kind != Vertex::Kind::Surface) continue;
            if (const auto j = join_next_event(scene, z, t, sampler, counts)) {
                const Vertex x0 = test::emitter_end(*j, z[t - 1]);
                const auto x = path_vertices(y, 1, z, t, &x0);
                const PathValue v = evaluate_path(scene, x, std::vector<bool>(x.size(), false));
                check(*j, x, v.pdfs.next_event * density_of(z, t));
            }
        }
        for (int s = 1; s <= y.size(); ++s)
            if (const auto j = join_splat(scene, y, s, sampler, counts)) {
                const Vertex lens = test::lens_end(scene, *j);
                check(*j, path_vertices(y, s, z, 1, nullptr, &lens),
                      density_of(y, s) * lens.pdf_fwd);
            }
    }
    EXPECT_GT(checked, 500);
    EXPECT_GE(tallies.size(), 3u);
    EXPECT_EQ(tallies.count(Strategy::Merge) > 0, counts.merge > 0);
    for (const auto& [strategy, tally] : tallies)
        EXPECT_LT(tally.deviating, 0.03 * tally.compared)
            << "strategy " << int(strategy) << ", " << tally.compared << " comparisons";
}

/// With delta events the stored discrete probabilities enter; then the weights of all techniques that can make a path,
/// each as computed by the technique itself from its own split of the same vertices, must sum to one.
TEST_P(Joins, StoredSumsEqualTheExplicitSum) {
    int compared = 0;
    for (uint32_t index = 0; index < 2000; ++index) {
        trace(index);
        for (int t = 2; t <= z.size(); ++t) {
            if (z[t - 1].kind != Vertex::Kind::Surface || !z[t - 1].may_connect) continue;
            for (int s = 2; s <= y.size(); ++s) {
                const auto j = join_connect(scene, y, s, z, t, counts);
                if (!j) continue;
                // Explicit densities: those the walks stored, and the four that the connection defines.
                const auto x = path_vertices(y, s, z, t);
                const int n = s + t;
                std::vector<bool> delta(x.size());
                for (int i = 0; i < n; ++i) delta[i] = i != s - 1 && i != s && x[i]->is_delta;
                PathPdfs p = evaluate_path(scene, x, delta).pdfs;
                for (int i = 0; i < s; ++i) {
                    p.light[i] = y[i].pdf_fwd;
                    if (i < s - 2) p.eye[i] = y[i].pdf_rev;
                }
                for (int i = 0; i < t; ++i) {
                    p.eye[n - 1 - i] = z[i].pdf_fwd;
                    if (i < t - 2) p.light[n - 1 - i] = z[i].pdf_rev;
                }
                tallies[Strategy::Connect].add(j->mis_weight, mis_weight(p, j->technique, counts));
                ++compared;
            }
        }
    }
    EXPECT_GT(compared, 100);
    EXPECT_LT(tallies[Strategy::Connect].deviating, 0.002 * compared + 1);
}

const auto kName = [](const ::testing::TestParamInfo<std::tuple<Case, Extra>>& p) {
    const char* suffix[] = {"", "_merges", "_gathers", "_variants", "_stored"};
    return std::get<Case>(p.param).name + std::string(suffix[int(std::get<Extra>(p.param))]);
};
INSTANTIATE_TEST_SUITE_P(Scenes, Joins,
                         ::testing::Combine(::testing::ValuesIn(cases()),
                                            ::testing::Values(Extra::None, Extra::Merges,
                                                              Extra::Gathers, Extra::Variants,
                                                              Extra::Stored)),
                         kName);

}  // namespace
}  // namespace etendue
