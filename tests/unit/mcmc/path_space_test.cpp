// Paths as states: densities against the reference definitions of path_pdfs.h; mutations keep detailed balance.

#include "mcmc/path_space.h"

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "mcmc/whole_film.h"
#include "path_passes.h"
#include "pathspace/path_pdfs.h"
#include "random_guide.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

using Kinds = std::vector<PathMutations::Kind>;

constexpr int kPixels = 8;

struct Case {
    const char* name;
    std::string xml;
    Kinds rare{};  ///< Mutations that only such scenes have, and that need more samples.
    float cone = 8, radius = 0.1f;  ///< Of user paths; the cone in degrees.
};
void PrintTo(const Case& c, std::ostream* out) {
    *out << c.name;
}

const std::string kConstant =
    "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3,0.4,0.5\"/></emitter>";

std::vector<Case> cases() {
    const std::string sky = room() + sphere("-0.5,-0.6,0.2", "0.35", kRoughMetal) +
                            sphere("0.1,0.2,-0.1", "0.3", kGlass) + kConstant;
    const std::string lens_scene = mixed_room(lens_camera(kPixels));
    // Two balls and a floor of rough metal: paths over several glossy reflections.
    const std::string kFloor =
        rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-0.95\"/>", kRoughMetal);
    const std::string glossy = front_camera(kPixels) + room() + area_lamp() + kFloor +
                               sphere("-0.4,-0.4,0.1", "0.45", kRoughMetal) +
                               sphere("0.5,-0.5,0.2", "0.4", kRoughMetal);
    // A veil with an opacity of 0.2 and 0.9, before mirrors, glass and rough metal.
    const std::string kMasked =
        "<bsdf type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"><float "
        "name=\"color0\" value=\"0.2\"/><float name=\"color1\" value=\"0.9\"/><transform "
        "name=\"to_uv\"><scale value=\"3\"/></transform></texture>" +
        diffuse("0.6,0.5,0.4") + "</bsdf>";
    const std::string veil = mixed_room(front_camera(kPixels)) +
                             rectangle("<scale value=\"0.9\"/><rotate x=\"1\" angle=\"-60\"/>"
                                       "<translate z=\"0.6\"/>",
                                       kMasked);
    // Smooth and delta events at one wall, where user paths from a large lamp end.
    const std::string kGloss =
        "<bsdf type=\"twosided\"><bsdf type=\"blendbsdf\"><float name=\"weight\" "
        "value=\"0.5\"/><bsdf type=\"diffuse\"/><bsdf type=\"conductor\"/></bsdf></bsdf>";
    const std::string gloss_wall =
        front_camera(kPixels) + room() +
        rectangle("<scale value=\"0.8\"/><rotate x=\"1\" angle=\"90\"/>"
                  "<translate y=\"0.98\"/>",
                  "<emitter type=\"area\"><rgb name=\"radiance\" value=\"2\"/></emitter>") +
        rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-0.99\"/>", kGloss);
    // Paths with several chains of mirrors.
    const std::string kMirror = "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>";
    const std::string mirrors =
        front_camera(kPixels) + room() + area_lamp() +
        rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-0.95\"/>", kMirror) +
        rectangle("<translate z=\"-0.95\"/>", kMirror);
    return {
        {"mixed", mixed_room(front_camera(kPixels))},
        {"thinlens", lens_scene},
        {"orthographic", mixed_room(sensor("0,0,3.4", "0,0,0", kPixels, "", "", "orthographic"))},
        {"sky", front_camera(kPixels) + sky},
        {"several", mixed_room(front_camera(kPixels)) + kConstant +
                        "<emitter type=\"point\"><point name=\"position\" "
                        "value=\"0,0.7,0.5\"/></emitter>"},
        {"sun", front_camera(kPixels) + room() + sphere("0.1,0.2,-0.1", "0.4", kGlass) +
                    "<emitter type=\"directional\"><vector name=\"direction\" "
                    "value=\"0.2,-0.4,-1\"/></emitter>"},
        {"glossy", glossy, {PathMutations::GlossyLens, PathMutations::GlossyCaustic}},
        {"veil", veil},
        {"gloss_wall", gloss_wall, {PathMutations::UserPath}, 40, 0.6f},
        {"mirrors", mirrors, {PathMutations::MultiChain}}};
}

class Paths : public ::testing::TestWithParam<Case> {
protected:
    Paths() : passes(build(GetParam().xml)) {}
    /// From the lamp to a wall, in the scenes that have a lamp there.
    std::optional<UserPaths> user_paths() const {
        for (const float wall : {-1.0f, -0.99f}) {
            const CheckedPath checked =
                check_user_path(passes.scene(), {.name = {},
                                                 .points = {{0.1f, 0.98f, 0.15f}, {wall, 0, 0.3f}},
                                                 .cones = {GetParam().cone},
                                                 .radius = GetParam().radius});
            if (checked.path) return UserPaths(passes.scene(), {*checked.path});
        }
        return {};
    }
    PathPasses passes;
};

/// f and the densities of every technique, of states that were drawn and of those that mutations make.
TEST_P(Paths, HaveTheValueAndDensitiesOfTheirVertices) {
    const auto space = passes.space({});
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const auto x = space->make_state(), y = space->make_state();
    const double A = double(passes.measure().film.area()), unit = passes.measure().unit_area;
    int tested = 0;
    const auto check = [&](const PathState& state) {
        std::vector<const Vertex*> vertices;
        std::vector<bool> delta;
        for (int i = 0; i < state.size(); ++i) {
            vertices.push_back(&state[i].v);
            delta.push_back(state[i].v.is_delta);
        }
        const PathValue value = evaluate_path(passes.scene(), vertices, delta);
        const int n = state.size();
        const double units = std::pow(unit, n);
        for (int s = 0; s <= n; ++s) {
            if (s == n && !passes.scene().sensor().has_finite_lens()) continue;
            const Technique q = connection_technique(s, n - s);
            // Where there are several emitters at infinity, an eye path that leaves the scene chooses one.
            const size_t escapes = passes.scene().infinite_emitters().size();
            const double choice =
                s == 0 && state[0].v.is_infinite && escapes > 0 ? double(escapes) : 1.0;
            // Walks pass the masks of their edges, and meet the surfaces there.
            double masks = 1;
            for (int i = 1; i < s; ++i)
                masks *= double(state[i - 1].transmittance * state[i].opacity);
            for (int i = s; i + 1 < n; ++i)
                masks *= double(state[i].transmittance * state[i].opacity);
            const double expected =
                masks * value.pdfs.density(q) * units / ((n - s >= 2 ? A : 1.0) * choice);
            ASSERT_NEAR(state.density(s), expected,
                        1e-3 * expected + 1e-12 * state.large_step_density())
                << "s = " << s;
        }
        double masks = 1;
        for (int i = 0; i + 1 < n; ++i) masks *= double(state[i].transmittance * state[i].opacity);
        for (int i = 0; i < 3; ++i) {
            const double expected = masks * double(value.f[i]) * units / state.large_step_density();
            ASSERT_NEAR(double(state.splats[0].value[i]), expected, 1e-3 * expected + 1e-12);
        }
        ++tested;
    };
    for (uint64_t i = 0; i < 6000; ++i) {
        space->draw(0, hash_combine(1, i), c, *x);
        if (!(x->target > 0)) continue;
        check(static_cast<const PathState&>(*x));
        space->propose(0, *x, hash_combine(2, i), c, *y);
        if (y->target > 0) check(static_cast<const PathState&>(*y));
    }
    EXPECT_GT(tested, 300);
}

TEST_P(Paths, AreSavedToTheBit) {
    const auto space = passes.space({});
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const auto x = space->make_state(), again = space->make_state(), y = space->make_state(),
               y_again = space->make_state();
    for (uint64_t i = 0; i < 2000; ++i) {
        space->draw(0, hash_combine(3, i), c, *x);
        if (!(x->target > 0)) continue;
        LearnedState saved;
        x->save(saved);
        LearnedState read(saved.bytes());
        again->load(read);
        LearnedState resaved;
        again->save(resaved);
        ASSERT_EQ(resaved.bytes(), saved.bytes());
        space->propose(0, *x, i, c, *y);
        space->propose(0, *again, i, c, *y_again);
        ASSERT_EQ(y->target, y_again->target);
    }
}

/// The joins of a state have its value, and weights with the sum 1.
TEST_P(Paths, AreToldAsJoins) {
    class Sum final : public ContributionSink {
    public:
        void add(const Join& join, Rgb contribution) override {
            value += contribution * join.mis_weight;
        }
        Rgb value;
    };
    const auto space = passes.space({});
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const auto x = space->make_state();
    for (uint64_t i = 0; i < 2000; ++i) {
        space->draw(0, hash_combine(4, i), c, *x);
        if (!(x->target > 0)) continue;
        Sum sum;
        space->repeat(0, *x, c, sum);
        for (int k = 0; k < 3; ++k)
            ASSERT_NEAR(sum.value[k], x->splats[0].value[k], 1e-4f * x->splats[0].value[k]);
    }
}

/// Each join of a sample of bidirectional path tracing is recalled as the path that it made: its weight is the target of
/// this path over the density of the technique, times the MIS weight.
TEST_P(Paths, AreRecalledFromSamples) {
    const auto space = passes.space({});
    const WeighedSample samples = passes.samples();
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const auto state = space->make_state();
    const auto& x = static_cast<const PathState&>(*state);
    const double A = double(passes.measure().film.area());
    const bool has_masks = passes.scene().has_masks();
    std::array<int, 5> found{};  // By strategy.
    int lost = 0;
    for (uint64_t i = 0; i < 1500; ++i) {
        const uint64_t key = hash_combine(8, i);
        std::vector<Find> finds;
        space->sample(key, c, finds);
        std::vector<Technique> techniques;
        Sampler sampler(SamplerKind::Independent, key);
        sampler.start(0, 0);
        samples.for_each_part(sampler, c,
                              [&](const Join& j, double) { techniques.push_back(j.technique); });
        ASSERT_EQ(techniques.size(), finds.size());
        for (size_t n = 0; n < finds.size(); ++n) {
            // Those near the smallest numbers are rounded.
            if (finds[n].weight < 1e-30) continue;
            const Technique& q = techniques[n];
            space->recall(finds[n], c, *state);
            if (!(x.target > 0)) {
                ++lost;
                continue;
            }
            ASSERT_EQ(x.size(), q.vertices());
            const double escapes = double(passes.scene().infinite_emitters().size());
            const auto density = [&](int s) {
                const double choice = s == 0 && x[0].v.is_infinite && escapes > 0 ? escapes : 1.0;
                return double(x.density(s) * choice / x.large_step_density());
            };
            const double from_technique = x.target / density(q.s);
            double sum = 0, own = 0;
            for (int s = 0; s <= x.size(); ++s) {
                const Technique r = connection_technique(s, x.size() - s);
                const double np = double(passes.counts().of(r)) * density(s) * (r.t >= 2 ? A : 1.0);
                sum += sqr(np);
                if (s == q.s) own = sqr(np);
            }
            // Masks are part of these densities, but not of those in MIS weights.
            const double expected = from_technique * own / sum;
            ASSERT_NEAR(finds[n].weight, expected, has_masks ? from_technique : 2e-3 * expected)
                << q.s << ", " << q.t;
            ++found[size_t(q.s == 0 ? 0 : q.s == 1 ? 1 : q.t >= 2 ? 2 : q.t == 1 ? 3 : 4)];
        }
    }
    EXPECT_GT(found[1], 100);
    EXPECT_GT(found[2], 100);
    EXPECT_GT(found[3], 100);
    // Where there are masks, all edges are traced again; by rounding, few of those that leave glass are then blocked.
    EXPECT_LE(lost, has_masks ? found[2] / 100 : 0);
    EXPECT_GT(found[0], hits_emitters(passes.scene()) ? 5 : -1);
}

/// Samples may select emitters and directions otherwise than paths do.
TEST_P(Paths, AreRecalledFromGuidedSamples) {
    const Guide guide = random_guide(passes.scene(), 4, 5);
    const auto space =
        passes.space({}, weighted_luminance(TargetMap(passes.scene().film())), {}, &guide);
    const WeighedSample samples = passes.samples(&guide);
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const auto state = space->make_state();
    const auto& x = static_cast<const PathState&>(*state);
    int compared = 0, lost = 0;
    for (uint64_t i = 0; i < 500; ++i) {
        const uint64_t key = hash_combine(8, i);
        std::vector<Find> finds;
        space->sample(key, c, finds);
        std::vector<Join> joins;
        Sampler sampler(SamplerKind::Independent, key);
        sampler.start(0, 0);
        samples.for_each_part(sampler, c, [&](const Join& j, double) { joins.push_back(j); });
        ASSERT_EQ(joins.size(), finds.size());
        for (size_t n = 0; n < finds.size(); ++n) {
            space->recall(finds[n], c, *state);
            if (!(x.target > 0)) {
                ++lost;
                continue;
            }
            ++compared;
            ASSERT_EQ(x.size(), joins[n].technique.vertices());
            ASSERT_EQ(x[0].v.emitter, joins[n].emitter) << joins[n].technique.s;
            if (joins[n].technique.s == 1 && !joins[n].to_infinity) {
                ASSERT_EQ(x[0].v.p, joins[n].b.p);
            }
        }
    }
    EXPECT_GT(compared, 500);
    EXPECT_LE(lost, passes.scene().has_masks() ? compared / 100 : 0);
}

bool has_no_edge_below(const PathState& x, double limit) {
    for (int i = 1; i < x.last(); ++i)
        if (!x[i - 1].v.is_infinite && double(length(x[i].v.p - x[i - 1].v.p)) < limit)
            return false;
    return true;
}

/// Independent states that follow user paths have another density T, but the same integrals of f: I/T, times any function
/// of the path, has the same mean.
TEST_P(Paths, LargeStepsThatFollowUserPathsHaveTheirDensity) {
    const std::optional<UserPaths> given = user_paths();
    if (!given) GTEST_SKIP() << "the scene has no lamp of its own";
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    // All paths, those that begin like the user path, and the lengths of these.
    constexpr size_t kFunctions = 3;
    std::array<std::array<Moments, kFunctions>, 2> means;
    std::array<double, 2> found{};  // Part of the states that begin like the user path.
    for (size_t i = 0; i < 2; ++i) {
        const auto space = passes.space({}, i == 0 ? UserSteps{} : UserSteps{given, 0.6});
        const auto x = space->make_state();
        const uint64_t states = i == 0 ? 1'000'000 : 100'000;
        for (uint64_t n = 0; n < states; ++n) {
            space->draw(0, hash_combine(7 + i, n), c, *x);
            std::array<double, kFunctions> value{};
            // The value of paths with arbitrarily short edges has no finite variance.
            const auto& path = static_cast<const PathState&>(*x);
            if (x->target > 0 && has_no_edge_below(path, 0.4)) {
                const double I = x->target;
                value[0] = I;
                if (path.density(*given, 2) > 0) {
                    value[1] = I, value[2] = I * path.last();
                    found[i] += 1 / double(states);
                }
            }
            for (size_t f = 0; f < kFunctions; ++f) means[i][f].add(value[f]);
        }
    }
    for (size_t f = 0; f < kFunctions; ++f)
        EXPECT_GT(welch_p(means[0][f], means[1][f], 0), sidak(1e-3, kFunctions))
            << "function " << f << ": " << means[0][f].mean() << " ± "
            << std::sqrt(means[0][f].squared_error()) << ", " << means[1][f].mean() << " ± "
            << std::sqrt(means[1][f].squared_error());
    EXPECT_GT(found[0], 2e-5);
    EXPECT_GT(found[1], 10 * found[0]);
}

/// What samples find has the same mean as independent states have, also if it is multiplied by a function of the path.
TEST_P(Paths, AreFoundInProportionToTheTarget) {
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const auto space = passes.space({});
    const auto state = space->make_state();
    const auto& x = static_cast<const PathState&>(*state);
    constexpr size_t kFunctions = 4;
    using Values = std::array<double, kFunctions>;
    const auto add = [&](double weight, Values& values) {
        // The value of paths with arbitrarily short edges has no finite variance.
        if (!(x.target > 0) || !has_no_edge_below(x, 0.3)) return;
        const Values functions{1, double(x.last()), double(x.film.x), double(x[1].v.p.y)};
        for (size_t f = 0; f < kFunctions; ++f) values[f] += weight * functions[f];
    };
    std::array<Moments, kFunctions> drawn, found;
    for (uint64_t i = 0; i < 100000; ++i) {
        Values values{};
        space->draw(0, hash_combine(9, i), c, *state);
        add(state->target, values);
        for (size_t f = 0; f < kFunctions; ++f) drawn[f].add(values[f]);
    }
    std::vector<Find> finds;
    for (uint64_t i = 0; i < 6000; ++i) {
        Values values{};
        finds.clear();
        space->sample(hash_combine(10, i), c, finds);
        for (const Find& find : finds) {
            space->recall(find, c, *state);
            add(find.weight, values);
        }
        for (size_t f = 0; f < kFunctions; ++f) found[f].add(values[f]);
    }
    for (size_t f = 0; f < kFunctions; ++f)
        EXPECT_GT(welch_p(drawn[f], found[f], 0), sidak(1e-4, kFunctions))
            << "function " << f << ": " << drawn[f].mean() << " ± "
            << std::sqrt(drawn[f].squared_error()) << ", " << found[f].mean() << " ± "
            << std::sqrt(found[f].squared_error());
}

/// Logarithm of a cosine or of 1/d², zero where there is none.
double log_of(double v) {
    return v > 0 ? std::log(v) : 0.0;
}

/// What a path is like: the factors of densities at both ends, and some of the middle. Their means must not change by a step.
std::vector<double> features(const PathState& x) {
    const int k = x.last();
    const auto edge = [&](int from, int to) {
        return log_of(double(to_area(1, x[from].v, x[to].v)));
    };
    const auto between = [&](int i) {
        return double(dot(direction(x[i].v, x[i - 1].v), direction(x[i].v, x[i + 1].v)));
    };
    const auto cosine = [&](int at, int to) {
        return x[at].v.has_cosine ? log_of(double(abs_dot(x[at].v.ng, direction(x[at].v, x[to].v))))
                                  : 0.0;
    };
    double edges = 0, cosines = 0, masks = 0, deltas = 0;
    for (int i = 1; i <= k; ++i) {
        edges += edge(i - 1, i);
        masks += log_of(double(x[i - 1].transmittance)) + log_of(double(x[i].opacity));
        deltas += x[i].v.is_delta;
    }
    for (int i = 1; i < k; ++i) cosines += cosine(i, i + 1);
    const Vertex &seen = x[k - 1].v, &first = x[1].v;
    return {double(x.film.x),
            double(x.film.y),
            double(k),
            edges,
            cosines,
            double(first.is_infinite ? 0.0f : first.p.y),
            double(seen.is_infinite ? 0.0f : seen.p.z),
            edge(k, k - 1),
            edge(k - 1, k - 2),
            edge(k - 2, k - 1),
            cosine(k - 1, k),
            cosine(k - 1, k - 2),
            edge(0, 1),
            edge(1, 0),
            edge(1, 2),
            cosine(1, 0),
            cosine(0, 1),
            between(k - 1),
            between(1),
            double(x[k - 2].v.gloss),
            double(x[1].v.gloss),
            masks,
            std::fabs(double(x.film.x) - kPixels / 2.0),  // beyond the film's border
            deltas,
            double(x[1].v.is_delta)};
}

/// From independent states x, whose density is T, the flow min(T(x) Q(x→y), T(y) Q(y→x)) is the same there and back. So
/// Σ min(1, T(y) Q(y→x) / (T(x) Q(x→y))) (h(y) - h(x)) has the mean zero for any h. With T in place of the target no state
/// counts more than another one. A proposal that T hardly changes is always accepted, whatever its Q. So the same is tested
/// with the target I, where x has the weight I(x)/T(x), over paths without short edges, whose weights are bounded.
class Flows {
public:
    void add(const PathState& x, const PathState& y, const Proposal& p) {
        const auto before = features(x), after = features(y);
        change_.resize(2 * before.size());
        const double rate = std::min(1.0, p.Q_ratio);
        const bool is_bounded = has_no_edge_below(x, 0.3) && has_no_edge_below(y, 0.3);
        const double flow = is_bounded ? std::min(x.target, y.target * p.Q_ratio) : 0.0;
        for (size_t f = 0; f < before.size(); ++f) {
            change_[2 * f].add(rate * (after[f] - before[f]));
            change_[2 * f + 1].add(flow * (after[f] - before[f]));
        }
        ++moves_;
    }
    uint64_t moves() const { return moves_; }
    /// A false alarm in 1 % of all suites of a hundred calls with fresh seeds.
    void expect_balance(const std::string& name) const {
        const double level = sidak(1e-4, change_.size());
        for (size_t f = 0; f < change_.size(); ++f) {
            if (!(change_[f].variance() > 0)) continue;
            EXPECT_GT(welch_p(change_[f], Moments::exact(0), 0), level)
                << name << ", feature " << f / 2 << (f % 2 ? " of the target: " : ": ")
                << change_[f].mean() << " ± " << std::sqrt(change_[f].squared_error()) << " of "
                << moves_ << " moves";
        }
    }

private:
    std::vector<Moments> change_;
    uint64_t moves_ = 0;
};

/// Moves of a mutation that a test needs to see much, in the scenes made for it, and to see anything, in all others.
constexpr uint64_t kMoves = 2000, kFewMoves = 200;

/// Each mutation alone.
TEST_P(Paths, MutationsKeepDetailedBalance) {
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    const Kinds& rare = GetParam().rare;
    for (int kind = 0; kind < PathMutations::kCount; ++kind) {
        PathMutations alone;
        alone.weights.fill(0);
        alone.weights[size_t(kind)] = 1;
        UserSteps user;
        if (kind == PathMutations::UserPath) {
            // Together with bidirectional mutations, whose density theirs is mixed with.
            if (!(user.paths = user_paths())) continue;
            user.share = 0.3;
            alone.weights[PathMutations::Bidirectional] = 1;
        }
        const auto space = passes.space(alone, user);
        const auto x = space->make_state(), y = space->make_state();
        Flows flows;
        const bool is_rare = std::find(rare.begin(), rare.end(), kind) != rare.end();
        // Few paths have chains before and behind a vertex: see ManifoldPerturbations.
        if (kind == PathMutations::Manifold) continue;
        const bool is_common = kind <= PathMutations::Caustic || kind >= PathMutations::LensSubpath;
        const uint64_t wanted = is_rare || is_common ? kMoves : kFewMoves;
        const uint64_t enough = is_rare ? 400000 : 60000;
        for (uint64_t i = 0; i < 600000; ++i) {
            // By then, a mutation that suits some paths of the scene has made a move.
            if (i >= enough && (flows.moves() == 0 || flows.moves() >= wanted)) break;
            space->draw(0, hash_combine(5, i), c, *x);
            if (!(x->target > 0)) continue;
            const Proposal p = space->propose(0, *x, hash_combine(6, i), c, *y);
            if (p.has_failed || !(y->target > 0)) continue;
            flows.add(static_cast<const PathState&>(*x), static_cast<const PathState&>(*y), p);
        }
        if (!is_rare && !is_common && flows.moves() == 0) continue;
        EXPECT_GE(flows.moves(), wanted) << PathMutations::kNames[size_t(kind)];
        flows.expect_balance(PathMutations::kNames[size_t(kind)]);
    }
}

/// A pane before the view, a lamp in a ball of glass, and a mirror. Between the mirror's ends the ratio of both measures changes
/// most.
TEST(ManifoldPerturbations, KeepDetailedBalance) {
    PathPasses passes(build(
        front_camera(kPixels) + room() + sphere("0,-0.3,0", "0.4", kGlass) +
        sphere("0.1,-0.3,0.1", "0.2",
               "<emitter type=\"area\"><rgb name=\"radiance\" value=\"20\"/></emitter>") +
        rectangle("<scale value=\"0.5\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.98\"/>",
                  "<emitter type=\"area\"><rgb name=\"radiance\" value=\"10\"/></emitter>") +
        rectangle("<rotate y=\"1\" angle=\"90\"/><translate x=\"-0.95\"/>",
                  "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>") +
        rectangle("<translate z=\"1.4\"/>", "<bsdf type=\"thindielectric\"/>")));
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    PathMutations alone;
    alone.weights.fill(0);
    alone.weights[PathMutations::Manifold] = 1;
    const auto space = passes.space(alone);
    const auto x = space->make_state(), y = space->make_state();
    Flows flows;
    for (uint64_t i = 0; i < 4000000; ++i) {
        space->draw(0, hash_combine(16, i), c, *x);
        if (!(x->target > 0)) continue;
        const Proposal p = space->propose(0, *x, hash_combine(17, i), c, *y);
        if (p.has_failed || !(y->target > 0)) continue;
        flows.add(static_cast<const PathState&>(*x), static_cast<const PathState&>(*y), p);
    }
    EXPECT_GE(flows.moves(), kMoves);
    flows.expect_balance("manifold");
}

/// The turned directions that a mutation proposes are those of which Q has a density, also where rays begin farther from
/// their surface than directions are turned.
TEST(EyeChains, ProposeWhatHasADensity) {
    const std::vector<Case> scenes = cases();
    const std::string near = scenes.back().xml;
    ASSERT_EQ(scenes.back().name, std::string("mirrors"));
    std::vector<double> impossible;
    for (const std::string& xml :
         {near, transformed(near, "<translate x=\"100\" y=\"50\" z=\"80\"/>")}) {
        PathPasses passes(build(xml));
        const WholeFilm whole(passes.pass());
        const ChainContext c{whole.sample, passes.work()};
        PathMutations alone;
        alone.weights.fill(0);
        alone.weights[PathMutations::MultiChain] = 1;
        const auto space = passes.space(alone);
        const auto x = space->make_state(), y = space->make_state();
        Moments without_density;
        for (uint64_t i = 0; i < 200000; ++i) {
            space->draw(0, hash_combine(10, i), c, *x);
            if (!(x->target > 0)) continue;
            const Proposal p = space->propose(0, *x, hash_combine(11, i), c, *y);
            if (!p.has_failed && y->target > 0) without_density.add(p.Q_ratio == 0);
        }
        EXPECT_GT(without_density.count(), 500);
        impossible.push_back(without_density.mean());
    }
    EXPECT_LT(impossible[0], 0.15);
    EXPECT_NEAR(impossible[1], impossible[0], 0.01);
}

/// All of them, so that the choice among those that suit a path is a part of Q.
TEST_P(Paths, AllMutationsTogetherKeepDetailedBalance) {
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    PathMutations all;
    all.weights[PathMutations::PhotonMap] = 2;
    UserSteps user;
    if ((user.paths = user_paths())) {
        user.share = 0.3;
        all.weights[PathMutations::UserPath] = 1;
    }
    const auto space = passes.space(all, user);
    const auto x = space->make_state(), y = space->make_state();
    Flows flows;
    for (uint64_t i = 0; i < 100000; ++i) {
        space->draw(0, hash_combine(8, i), c, *x);
        if (!(x->target > 0)) continue;
        const Proposal p = space->propose(0, *x, hash_combine(9, i), c, *y);
        if (p.has_failed || !(y->target > 0)) continue;
        flows.add(static_cast<const PathState&>(*x), static_cast<const PathState&>(*y), p);
    }
    flows.expect_balance("all mutations");
}

/// The choice of the mutation, exactly: Q is that of the mutation alone, times the probability with which it is chosen
/// among those that suit the path. Flows see little of it, since most steps are of mutations that suit both paths.
TEST_P(Paths, MutationsAreChosenAmongThoseThatSuit) {
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    PathMutations all;
    all.weights[PathMutations::PhotonMap] = 2;
    const auto space = passes.space(all);
    std::array<std::unique_ptr<PathSpace>, PathMutations::kCount> alone;
    for (int kind = 0; kind < PathMutations::kCount; ++kind) {
        PathMutations one;
        one.weights.fill(0);
        one.weights[size_t(kind)] = all.weights[size_t(kind)];
        alone[size_t(kind)] = passes.space(one);
    }
    const auto x = space->make_state(), y = space->make_state(), again = space->make_state();
    using Pmf = std::array<double, PathMutations::kCount>;
    const auto pmf_at = [&](const ChainState& at) {
        Pmf pmf{};
        double sum = 0;
        for (int kind = 0; kind < PathMutations::kCount; ++kind) {
            // Where its only mutation does not suit, a space proposes nothing, under the name of the first one.
            const Proposal p = alone[size_t(kind)]->propose(0, at, 1, c, *again);
            if (p.mutation == kind) sum += pmf[size_t(kind)] = all.weights[size_t(kind)];
        }
        for (double& p : pmf) p /= sum;
        return pmf;
    };
    std::array<Moments, PathMutations::kCount>
        excess;  // Of proposals of a kind, over the expected number.
    int moves = 0, between_choices = 0;
    for (uint64_t i = 0; i < 20000; ++i) {
        space->draw(0, hash_combine(10, i), c, *x);
        if (!(x->target > 0)) continue;
        const Pmf at_x = pmf_at(*x);
        const uint64_t key = hash_combine(11, i);
        const Proposal p = space->propose(0, *x, key, c, *y);
        for (size_t kind = 0; kind < at_x.size(); ++kind)
            excess[kind].add(double(p.mutation == int(kind)) - at_x[kind]);
        if (p.has_failed || !(y->target > 0)) continue;
        const auto kind = size_t(p.mutation);
        const Proposal of_kind = alone[kind]->propose(0, *x, key, c, *again);
        ASSERT_EQ(again->target, y->target);
        const double choice = pmf_at(*y)[kind] / at_x[kind];
        ASSERT_NEAR(p.Q_ratio, of_kind.Q_ratio * choice, 1e-9 * p.Q_ratio)
            << PathMutations::kNames[kind];
        ++moves;
        between_choices += of_kind.Q_ratio > 0 && std::fabs(choice - 1) > 1e-3;
    }
    EXPECT_GT(moves, 300);
    EXPECT_GT(between_choices, 10);
    for (size_t kind = 0; kind < excess.size(); ++kind) {
        if (!(excess[kind].variance() > 0)) continue;
        EXPECT_GT(welch_p(excess[kind], Moments::exact(0), 0), sidak(1e-4, excess.size()))
            << PathMutations::kNames[kind];
    }
    RecordProperty("moves", moves);
    RecordProperty("between_choices", between_choices);
}

/// States whose target is not finite contribute nothing, and are counted.
TEST_P(Paths, ThatAreNotFiniteAreCounted) {
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    for (const double value : {HUGE_VAL, -HUGE_VAL, std::nan("")}) {
        const auto usual = passes.space({});
        const auto space = passes.space({}, [value](const PathState&, Rgb) { return value; });
        const auto x = usual->make_state(), next = usual->make_state(), y = space->make_state();
        uint64_t expected = 0;
        const uint64_t before = passes.work().stats.rejected;
        for (uint64_t i = 0; i < 2000; ++i) {
            usual->draw(0, hash_combine(12, i), c, *x);
            space->draw(0, hash_combine(12, i), c, *y);
            expected += x->target > 0;
            ASSERT_EQ(y->target, 0);
            ASSERT_TRUE(y->splats.empty());
            if (!(x->target > 0)) continue;
            const Proposal p = usual->propose(0, *x, hash_combine(13, i), c, *next);
            expected += next->target > 0;
            EXPECT_EQ(space->propose(0, *x, hash_combine(13, i), c, *y).has_failed, p.has_failed);
            ASSERT_EQ(y->target, 0);
        }
        EXPECT_GT(expected, 100u);
        EXPECT_EQ(passes.work().stats.rejected - before, expected) << value;
    }
}

/// In a closed sphere no ray is lost and all points see each other. There, bidirectional mutations rarely propose what cannot
/// be a new path, whatever is traced.
TEST(Bidirectional, FewProposalsAreVoid) {
    PathPasses passes(
        build(sensor("0,0,0.99", "0,0,0", kPixels, "172") +
              "<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"true\"/>" +
              diffuse("0.5,0.5,0.5") + "</shape>" +
              "<emitter type=\"point\"><point name=\"position\" value=\"0.3,0.5,0\"/></emitter>"));
    const WholeFilm whole(passes.pass());
    const ChainContext c{whole.sample, passes.work()};
    PathMutations alone;
    alone.weights.fill(0);
    alone.weights[PathMutations::Bidirectional] = 1;
    const auto space = passes.space(alone);
    const auto x = space->make_state(), y = space->make_state();
    int proposals = 0, is_void = 0;
    for (uint64_t i = 0; i < 40000; ++i) {
        space->draw(0, hash_combine(14, i), c, *x);
        if (!(x->target > 0)) continue;
        const Proposal p = space->propose(0, *x, hash_combine(15, i), c, *y);
        const auto &before = static_cast<const PathState&>(*x),
                   &after = static_cast<const PathState&>(*y);
        const auto is_same = [&] {
            if (before.last() != after.last()) return false;
            for (int k = 0; k <= before.last(); ++k)
                if (!(before[k].v.p == after[k].v.p)) return false;
            return true;
        };
        ++proposals;
        is_void += p.has_failed || is_same();
    }
    EXPECT_GT(proposals, 5000);
    EXPECT_LT(is_void, 0.06 * proposals) << is_void << " of " << proposals;
}

/// A light path that ends without a direction does not hit the lens along its last ray.
TEST(PathBuilder, HitsTheLensByNewDirections) {
    // From a lamp through rough glass, whose sampling sometimes fails, to a wide lens. The lens is nearer to the glass than
    // the lamp, so that a ray as long as the last one reaches it.
    const Scene scene = build(
        sensor("0,0,2", "0,0,0", kPixels, "60",
               "<float name=\"aperture_radius\" value=\"1\"/><float name=\"focus_distance\" "
               "value=\"2\"/>",
               "thinlens") +
        rectangle("<translate z=\"-4\"/>", diffuse("0.5,0.5,0.5") +
                                               "<emitter type=\"area\"><rgb name=\"radiance\" "
                                               "value=\"2,2,2\"/></emitter>") +
        rectangle("<scale value=\"3\"/>", "<bsdf type=\"roughdielectric\"><float name=\"alpha\" "
                                          "value=\"0.8\"/></bsdf>"));
    const PathMeasure measure(scene, reached_region(scene.film(), scene.filter()), 2, 2);
    const PathTarget target{measure, weighted_luminance(TargetMap(scene.film())),
                            LengthChoice(2, 2, {}), TechniqueChoice(scene, 2, 1, {})};
    PathState y(target);
    Workspace work;
    int hits = 0;
    for (uint64_t i = 0; i < 200000; ++i) {
        Sampler sampler(SamplerKind::Independent, hash_combine(14, i));
        sampler.start(0, 0);
        PathBuilder builder(measure, sampler, work, nullptr, -1, 0);
        if (!builder.sample(3, 0) || !builder.finish(y)) continue;
        ++hits;
        const Vec3 before = direction(y[0].v, y[1].v), after = direction(y[1].v, y[2].v);
        ASSERT_GT(length(after - before), 1e-5f) << "sample " << i;
    }
    EXPECT_GT(hits, 1000);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Paths, ::testing::ValuesIn(cases()),
                         [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace etendue::test
