// Joins and MIS weights against the reference definitions of path_pdfs.h, on random paths with all kinds of events.

#include <algorithm>
#include <map>

#include <gtest/gtest.h>

#include "path_ends.h"
#include "pathspace/path_pdfs.h"
#include "random_guide.h"
#include "test_scenes.h"

namespace etendue {
namespace {

constexpr int kPixels = 8;

struct JoinCase {
    const char* name;
    std::string xml;
    bool has_delta = false;  ///< Smooth glass and coats.
};

std::vector<JoinCase> join_cases() {
    using namespace test;
    const std::string spheres =
        sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) + sphere("0.4,-0.65,0.3", "0.3", kRoughGlass);
    return {
        {"mixed", mixed_room(front_camera(kPixels)), true},
        {"thinlens", mixed_room(lens_camera(kPixels)), true},
        {"orthographic", mixed_room(sensor("0,0,3.4", "0,0,0", kPixels, "", "", "orthographic")),
         true},
        // Paths that end inside glass: their refractions do not undo each other.
        {"inside_glass",
         front_camera(kPixels) + room() + area_lamp() + sphere("0,-0.2,0.2", "0.7", kGlass) +
             sphere(
                 "0.1,-0.1,0.2", "0.3",
                 diffuse("0.5,0.6,0.5") +
                     "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3,2,1\"/></emitter>"),
         true},
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
             "<emitter type=\"point\"><point name=\"position\" value=\"0,0.7,0.5\"/></emitter>",
         true},
    };
}

/// Techniques in addition to those of bidirectional path tracing. Variants: other parameters of gathers.
enum class Extra { None, Merges, Gathers, Variants, Stored, Guided, GuidedMerges };

/// Shares of pairs between 1 and about 1/20, from cell to cell.
struct RandomLevels final : LearnedPlaces {
    uint8_t pair_level(Vec3 p) const override {
        uint64_t key = 0;
        for (int i = 0; i < 3; ++i)
            key = hash_combine(key, uint64_t(int64_t(std::floor(p[i] * 4))));
        return uint8_t(key % 70);
    }
};

class Joins : public ::testing::TestWithParam<std::tuple<JoinCase, Extra>> {
protected:
    Joins()
        : scene(test::build(std::get<JoinCase>(GetParam()).xml)),
          film(scene.film(), scene.filter()), sampler(SamplerKind::Independent, 7) {
        const float N = kPixels * kPixels;
        counts = {.hit = 1,
                  .next_event = 1,
                  .connect = 1,
                  .splat = N,
                  .hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f};
        if (extra() == Extra::Stored) {
            counts.connect = 5;
            counts.connect_emission = 3;
            counts.repeated_next_event = 4;
        } else if (extra() != Extra::None) {
            const bool merges = extra() == Extra::Merges || extra() == Extra::GuidedMerges;
            (merges ? counts.merge : counts.gather) = N;
            // Large enough for the clamp of gathers to matter now and then.
            counts.pairs.disc = 0.3f;
            counts.pairs.inner_disc = 0.1f;
            counts.pairs.min_edges = merges ? 2 : 3;
            if (merges)
                counts.continued = 0.5f;
            else
                counts.connect = 0.25f;
            counts.repeated_next_event = merges ? 3 : 2;
            if (extra() == Extra::GuidedMerges) counts.pairs.first_merge = 2;
            if (extra() == Extra::Variants) {
                counts.pairs.rule = PairRule::Both;
                counts.pairs.clamps = false;
            }
        }
        if (extra() == Extra::Guided || extra() == Extra::GuidedMerges) {
            // The density of a lobe changes by κ dθ, which enlarges the difference of directions that Tally describes.
            constexpr float kKappa = 10;
            guide = test::random_guide(scene, kKappa, 3);
            counts.guide = &guide;
        }
    }

    static Extra extra() { return std::get<Extra>(GetParam()); }
    const LearnedPlaces* learned() const {
        return extra() == Extra::Merges || extra() == Extra::Variants ? &levels : nullptr;
    }

    /// Both sub-paths of sample `index`, without roulette by throughput.
    void trace(uint32_t index) {
        sampler.start(index, index % (kPixels * kPixels));
        const WalkContext walk{scene, counts, stats, {6, 1000}, learned()};
        start_light_path(walk, sampler, y);
        if (y.size() > 0) check_hit_lens(1);
        for (int s = 2; s <= y.size(); ++s) {
            extend<TransportMode::Importance>(walk, sampler, y);
            check_hit_lens(s);
        }
        trace_eye_path(walk, film, index % (kPixels * kPixels), sampler, z);
    }

    /// Compares a join with the path's own definition. End points of the join are connectible by any other event too.
    void check(const Join& join, const std::vector<const Vertex*>& x, double p_sampled) {
        const int s = join.technique.s;
        const auto delta = delta_events(x, s - 1, s);
        const PathValue value = evaluate_path(scene, x, delta, counts.guide);
        const double p = value.pdfs.density(join.technique);
        ASSERT_GT(p, 0);
        p_sampled *= eye_jacobian(x, delta, s + 1);
        Tally& tally = tally_of(join.technique.strategy, x, delta);
        tally.add(p_sampled / p, 1);
        for (int c = 0; c < 3; ++c)
            if (value.f[c] > 0)
                tally.add(join.contribution[c] * p * survival(join.technique.t) / value.f[c], 1);
        tally.add(join.mis_weight, mis_weight(value.pdfs, join.technique, counts));
        ++checked;
    }

    /// δ of the direction toward the light over that of the direction toward the eye, which evaluate_path() refers to,
    /// at a delta event of an eye sub-path.
    static double eye_jacobian(const Vertex& z) {
        const auto to_light = z.bsdf.sample_delta(z.wo, z.event, TransportMode::Radiance);
        const auto to_eye = z.bsdf.sample_delta(to_light->wi, z.event, TransportMode::Importance);
        EXPECT_NEAR(dot(to_eye->wi, z.wo), 1, 1e-4) << "the event is not its own reverse";
        return double(to_eye->pdf_rev) / double(to_light->pdf);
    }
    /// The product of them over the delta events from x_begin on.
    static double eye_jacobian(const std::vector<const Vertex*>& x, const std::vector<bool>& delta,
                               int begin) {
        double product = 1;
        for (size_t i = size_t(begin); i < x.size(); ++i)
            if (delta[i]) product *= eye_jacobian(*x[i]);
        return product;
    }
    /// Probability that the roulette of TechniqueCounts::continued lets the eye walk reach z_{t-1}.
    double survival(int t) const {
        double p = 1;
        for (int i = 1; i <= t - 2; ++i) p *= double(z[i].survival.value());
        return p;
    }
    /// Which events of the walks are delta events; those at x_a and x_b, where the path was joined, are not.
    static std::vector<bool> delta_events(const std::vector<const Vertex*>& x, int a, int b) {
        std::vector<bool> delta(x.size());
        for (int i = 0; i < int(x.size()); ++i)
            delta[size_t(i)] = i != a && i != b && x[size_t(i)]->is_delta;
        return delta;
    }

    /// The last ray of y, which left y_{s-1}, where it meets the lens.
    void check_hit_lens(int s) {
        const auto j = join_hit_lens(scene, y, s, counts);
        if (!j) return;
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

    /// Treats any two vertices as a pair: contribution and weight are those of the path without the dropped vertex.
    void check_gather(int s, int t) {
        if (!y[s - 1].is_connectible || !z[t - 1].is_connectible) return;
        for (const bool eye : {true, false})
            if (drops(counts.pairs.rule, eye, gloss(y[s - 2], y[s - 2].is_delta),
                      gloss(z[t - 2], z[t - 2].is_delta)))
                check_gather(s, t, eye);
    }
    void check_gather(int s, int t, bool drops_eye) {
        const auto j = join_gather(scene, y, s, z, t, drops_eye, counts);
        if (!j) return;
        const auto x = path_vertices(y, drops_eye ? s : s - 1, z, drops_eye ? t - 1 : t);
        const int m = s - 1;
        const auto delta = delta_events(x, m, drops_eye ? m + 1 : m - 1);
        const PathValue value = evaluate_path(scene, x, delta, counts.guide);
        const double p = density_of(y, drops_eye ? s : s - 1) *
                         density_of(z, drops_eye ? t - 1 : t) *
                         eye_jacobian(x, delta, drops_eye ? s : s - 1);
        Tally& tally = tally_of(Strategy::Gather, x, delta);
        for (int c = 0; c < 3; ++c)
            if (value.f[c] > 0) tally.add(j->contribution[c] * p / value.f[c], 1);
        tally.add(j->mis_weight, mis_weight(value.pdfs, j->technique, counts));
    }

    /// z_{t-1} as if the light path had found it too, from y_{s-2}: where the two coincide a merge is its definition.
    void check_merge(int s, int t) {
        const Vertex &b = z[t - 1], &from = y[s - 2];
        if (!b.is_connectible || !from.is_connectible) return;
        SubPath merged;
        for (int i = 0; i < s - 1; ++i) merged.append() = y[i];
        merged[s - 2].is_delta = false;
        Vertex& a = merged.append();
        a = b;
        a.wo = from.is_infinite ? from.p : normalize(from.p - b.p);
        if (s == 2) {
            const BsdfEval e = from.eval(-a.wo, TransportMode::Importance);
            if (e.f.is_zero()) return;
            a.beta = from.beta * e.f / e.pdf;
            a.pdf_fwd = to_area(e.pdf, from, b);
            a.next_event_ratio = next_event_ratio(from, a, -a.wo, counts.guide);
            a.weight_sum = 0;
        } else {
            const BsdfEval f = from.eval(-a.wo, TransportMode::Importance);
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
        const auto delta = delta_events(x, s - 1, s - 1);
        const PathValue value = evaluate_path(scene, x, delta, counts.guide);
        const float disc = b.is_fixed_by_film ? counts.pairs.disc : counts.pairs.inner_disc;
        const double p =
            density_of(merged, s) * density_of(z, t) * double(disc) * eye_jacobian(x, delta, s);
        Tally& tally = tally_of(Strategy::Merge, x, delta);
        for (int c = 0; c < 3; ++c)
            if (value.f[c] > 0) tally.add(j->contribution[c] * p * survival(t) / value.f[c], 1);
        tally.add(j->mis_weight, mis_weight(value.pdfs, j->technique, counts));
        // The same flux without its path.
        const auto alone = join_photon({a.p, a.wo, a.beta, y[0].emitter, s}, z, t, disc);
        EXPECT_EQ(alone->contribution.g, j->contribution.g);
    }

    /// A few comparisons deviate by more than rounding, see error_of_offsets(); a wrong factor makes all of its strategy
    /// deviate.
    struct Tally {
        int compared = 0, deviating = 0;
        void add(double fast, double slow) {
            ++compared;
            deviating += !(std::fabs(fast - slow) < 2e-3);
        }
    };
    static constexpr double kTolerance = 0.02;

    /// Rays start a little off their surface, so the walk's directions differ from those between the stored points, by
    /// dθ = offset/d along an edge of length d. This is a bound of the relative change dθ/cos θ of the cosines. Paths where
    /// it is large are not compared. They are more frequent with a random guide, since its directions are less often
    /// along the normal: without this limit, up to 5.1 % of all comparisons deviate with a guide, and 1.2 % without; with
    /// a limit of 10⁻⁴ 0.2 % do.
    double error_of_offsets(const std::vector<const Vertex*>& x) const {
        double sum = 0;
        for (size_t i = 0; i + 1 < x.size(); ++i) {
            const Vertex &a = *x[i], &b = *x[i + 1];
            if (a.is_infinite || b.is_infinite) continue;
            const Vec3 w = direction(a, b);
            const float offset = length(offset_origin(a.ray_end(), w) - a.p);
            for (const Vertex* v : {&a, &b})
                if (v->kind == Vertex::Kind::Surface)
                    sum += double(offset / (length(b.p - a.p) * abs_dot(v->ng, w)));
        }
        return sum;
    }

    Tally& tally_of(Strategy strategy, const std::vector<const Vertex*>& x,
                    const std::vector<bool>& delta) {
        constexpr double kMostError = 3e-4;
        if (error_of_offsets(x) > kMostError) return unclear;
        const bool has_delta = std::count(delta.begin(), delta.end(), true) > 0;
        return has_delta ? delta_tallies[strategy] : tallies[strategy];
    }

    static double density_of(const SubPath& path, int count) {
        double p = 1;
        for (int i = 0; i < count; ++i) p *= path[i].pdf_fwd;
        return p;
    }

    Scene scene;
    Film film;
    Sampler sampler;
    TechniqueCounts counts;
    Guide guide;
    RandomLevels levels;
    SubPath y, z;
    RenderStats stats;
    std::map<Strategy, Tally> tallies,
        delta_tallies;  ///< Of paths without delta events, and with some.
    Tally unclear;      ///< Of those where offsets of rays change the densities much.
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
                const PathValue v =
                    evaluate_path(scene, x, std::vector<bool>(x.size(), false), counts.guide);
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
        EXPECT_LT(tally.deviating, kTolerance * tally.compared)
            << "strategy " << int(strategy) << ", " << tally.compared << " comparisons";
    if (std::get<JoinCase>(GetParam()).has_delta) {
        EXPECT_GE(delta_tallies.size(), 3u);
    }
    for (const auto& [strategy, tally] : delta_tallies)
        EXPECT_LT(tally.deviating, kTolerance * tally.compared)
            << "with delta events: strategy " << int(strategy) << ", " << tally.compared
            << " comparisons";
}

/// With delta events the stored discrete probabilities enter; then the weights of all techniques that can make a path,
/// each as computed by the technique itself from its own split of the same vertices, must sum to one.
TEST_P(Joins, StoredSumsEqualTheExplicitSum) {
    int compared = 0;
    for (uint32_t index = 0; index < 2000; ++index) {
        trace(index);
        for (int t = 2; t <= z.size(); ++t) {
            if (z[t - 1].kind != Vertex::Kind::Surface || !z[t - 1].is_connectible) continue;
            for (int s = 2; s <= y.size(); ++s) {
                const auto j = join_connect(scene, y, s, z, t, counts);
                if (!j) continue;
                // Explicit densities: those the walks stored, and the four that the connection defines.
                const auto x = path_vertices(y, s, z, t);
                const int n = s + t;
                std::vector<bool> delta(x.size());
                for (int i = 0; i < n; ++i) delta[i] = i != s - 1 && i != s && x[i]->is_delta;
                PathPdfs p = evaluate_path(scene, x, delta, counts.guide).pdfs;
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

const auto kName = [](const ::testing::TestParamInfo<std::tuple<JoinCase, Extra>>& p) {
    const char* suffix[] = {"",        "_merges", "_gathers",      "_variants",
                            "_stored", "_guided", "_guided_merges"};
    return std::get<JoinCase>(p.param).name + std::string(suffix[int(std::get<Extra>(p.param))]);
};
INSTANTIATE_TEST_SUITE_P(Scenes, Joins,
                         ::testing::Combine(::testing::ValuesIn(join_cases()),
                                            ::testing::Values(Extra::None, Extra::Merges,
                                                              Extra::Gathers, Extra::Variants,
                                                              Extra::Stored, Extra::Guided,
                                                              Extra::GuidedMerges)),
                         kName);

}  // namespace
}  // namespace etendue
