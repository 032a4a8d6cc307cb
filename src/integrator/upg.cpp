// Unbiased photon gathering [Qin et al. 2015]: an eye vertex and a light vertex near it form a pair. One of the two is
// dropped, and the other is joined by a shadow ray to the predecessor of the dropped one. Bernoulli trials estimate the
// reciprocal of the probability that the pair was found.
//
// Techniques: U(s,t), for paths of three edges and more; `upg+bdpt` also has C(s,t) and X(s,t). Unbiased for the paths it can
// make. `upg` alone cannot make short paths, and paths where every vertex, or both of its neighbours, scatter by delta events.

#include "integrator/upg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/bdpt.h"
#include "integrator/light_path_options.h"
#include "integrator/pair_pilot.h"
#include "integrator/radius_params.h"
#include "integrator/seen_extent.h"
#include "reuse/gather.h"
#include "reuse/gather_constants.h"
#include "reuse/gather_radius.h"
#include "reuse/gather_weight_scale.h"
#include "reuse/next_event_count.h"

namespace etendue {
namespace {

constexpr std::array<Choice<TrialBound>, 3> kBounds{
    {{"box", TrialBound::Box}, {"cone", TrialBound::Cone}, {"slab", TrialBound::Slab}}};
constexpr std::array<Choice<PairRule>, 4> kRules{{{"gloss", PairRule::Gloss},
                                                  {"eye", PairRule::Eye},
                                                  {"light", PairRule::Light},
                                                  {"both", PairRule::Both}}};

class UpgIntegrator final : public Integrator {
public:
    UpgIntegrator(const IntegratorParams& p, bool connects)
        : paths_(p, Guiding(p), connects ? Specular(p) : Specular()),
          given_radius_(radius_param(p)), connects_(connects), light_(p),
          bound_(p.choice("bound", kBounds)),
          flatness_(bound_ == TrialBound::Slab ? kGatherConstants.flatness : 1.0f),
          rule_(p.choice("drop", kRules)) {}

    void learn(const LearnContext& pass) override {
        paths_.learn(pass);
        // Where memory ends, all is as it was, since this is called again and would learn from its own changes.
        Learned next = learned_;
        if (connects_) next.weight_scale.learn(next.gathers);
        next.roulette.learn(next.gathers);
        if (pass.film.passes() > 0) {  // see prepare()
            next.radius.learn(pass.film, pass.so_far, next.gathers);
            if (connects_) next.next_events.learn(next.radius.observed(), next.gathers);
            density_ = PairDensity(cells(), next.radius.of(false), kGatherConstants.correlation);
        }
        learned_ = next;
    }
    void save(LearnedState& to) const override {
        paths_.save(to);
        to.put(learned_);
        density_.save(to);
        cells().save(to);
    }
    void load(LearnedState& from) override {
        paths_.load(from);
        from.get(learned_);
        density_.load(from);
        loaded_.load(from);
        inner_grid_ = {};
    }
    bool is_learning() const override { return true; }
    std::unique_ptr<PassSums> make_sums() const override { return std::make_unique<GatherSums>(); }
    void collect(std::span<const std::unique_ptr<PassSums>> workers) override {
        learned_.gathers.add(workers);
    }

    void prepare(const PassContext& pass) override {
        paths_.train(pass, counts(pass.scene, pass.light_paths), GuidedWalks::BothWithPairs);
        paths_.prepare_specular(pass, counts(pass.scene, pass.light_paths));
        if (pass.film.passes() == 0) start(pass);
    }
    void trace(const PassContext& pass) override {
        cache_.begin(pass.chunks(pass.light_paths), kVertexBytes, light_.memory,
                     paths_.guiding().guide());
        trace_light_paths(paths_, pass, counts(pass.scene, pass.light_paths), pass.light_paths,
                          cache_, &density_);
        cache_.assemble();
        inner_grid_.build(cache_, learned_.radius.of(false));
        if (has_two_grids()) seen_grid_.build(cache_, learned_.radius.of(true));
        loaded_ = {};
    }

    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        paths_.trace_eye_paths(c, counts(c[0].scene, c[0].light_paths), z, stats, &density_);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths);
        const SubPath &y = work.y, &z = work.z;
        const GatherSearch search{.c = c,
                                  .n = n,
                                  .cache = cache_,
                                  .seen_grid = has_two_grids() ? seen_grid_ : inner_grid_,
                                  .inner_grid = inner_grid_,
                                  .density = density_,
                                  .roulette = learned_.roulette,
                                  .max_depth = paths_.max_depth(),
                                  .flatness = flatness_,
                                  .threshold = paths_.threshold(c),
                                  .work = work};
        if (connects_) cache_.restore(c.scene, c.own_light_path(), work.y);
        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        const auto roulette = paths_.roulette(c, work);
        for (int t = 2; t <= z.size(); ++t) {
            paths_.add_hits(c, n, t, work);  // C(0,t)
            if (!paths_.is_joinable(z, t)) continue;
            if (connects_) {
                paths_.add_specular(c, n, t, work);  // X(s,t)
                add_next_events(c, n, t, work);      // C(1,t)
                const PhaseTimer of_connections(work.stats, &PhaseSeconds::connections);
                for (int s = 2; s <= y.size() && s + t - 1 <= paths_.max_depth(); ++s)
                    paths_.add_connection(c, n, y, s, t, roulette, work);  // C(s,t)
            }
            search.for_each_pair(
                t, [&](const GatherPair& pair) { gather(c, n, search, pair, work); });  // U(s,t)
        }
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n;
        if (connects_) {
            n = Bidirectional::counts(scene, light_paths);
            n.connect = kGatherConstants.connections;
            n.repeated_next_event = float(learned_.next_events.value());
        }
        n.gather = float(light_paths) * (connects_ ? learned_.weight_scale.value() : 1.0f);
        n.pairs = {.disc = kPi * sqr(learned_.radius.of(true)),
                   .inner_disc = kPi * sqr(learned_.radius.of(false)),
                   .min_edges = 3,
                   .rule = rule_};
        n.guide = paths_.guiding().guide();
        n.specular_depth = paths_.specular().depth(scene);
        return n;
    }
    uint64_t light_paths(const Scene& scene) const override {
        return light_.count(scene, paths_.depth(), paths_.vertex_bytes(kVertexBytes));
    }
    uint64_t light_path_memory() const override { return light_.memory; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    std::vector<std::pair<std::string, double>> figures() const override {
        std::vector<std::pair<std::string, double>> figures{
            {"radius", learned_.radius.of(true)},
            {"inner_radius", learned_.radius.of(false)},
            {"weight_scale", connects_ ? learned_.weight_scale.value() : 1}};
        if (connects_) figures.push_back({"next_events", learned_.next_events.value()});
        paths_.guiding().add_figures(figures);
        paths_.specular().add_figures(figures);
        return figures;
    }

private:
    bool has_two_grids() const { return learned_.radius.of(true) != learned_.radius.of(false); }
    /// Number of light vertices by cell, in the previous pass.
    CellCounts cells() const {
        return inner_grid_.points().is_empty() ? loaded_ : inner_grid_.points().counts();
    }

    /// Adds C(1,t), with several next events where the film point fixes z_{t-1}, and records these for later passes.
    void add_next_events(const SampleContext& c, const TechniqueCounts& n, int t,
                         Workspace& work) const {
        const SubPath& z = work.z;
        NextEventDraws draws;
        draws.count = z[t - 1].is_fixed_by_film ? uint32_t(n.repeated_next_event) : 1;
        for (uint32_t i = 0; i < draws.count; ++i) {
            const auto join = join_next_event(c.scene, z, t, c.sampler, n, i);
            const auto value = paths_.add(c, join, work, 1 / float(draws.count), i);
            if (!join) continue;
            NextEventDraw& draw = draws.draws[i];
            draw = {.contribution = luminance(join->contribution), .weight = join->mis_weight};
            if (value && draw.contribution > 0) draw.passed = luminance(*value) / draw.contribution;
        }
        const float pixel = c.expected_of_pixel();
        if (z[t - 1].is_fixed_by_film && pixel > 0)
            NextEventCount::observe(draws.span(), double(std::fabs(z.film_weight) / pixel),
                                    GatherSums::of(work));
    }

    /// Adds the join U(s,t) of a pair: one of its vertices is dropped, and the other is joined to the predecessor of
    /// the dropped one by a shadow ray. r estimates 1/p_c by Bernoulli trials.
    void gather(const SampleContext& c, const TechniqueCounts& n, const GatherSearch& search,
                const GatherPair& pair, Workspace& work) const {
        const auto& [strategy, s, t, drops_eye] = pair.technique;
        const auto join = join_gather(c.scene, work.pair, s, work.z, t, drops_eye, n);
        search.observe(pair, join);
        if (!join) return;
        const auto value = paths_.test(
            c, *join, search.scale() / (pair.survival * join->pair_probability), pair.number, work);
        if (!value) return;
        ++work.stats.visible_pairs;
        PairEvent event = pair.event(work.pair, work.z);
        event.bound = bound_;
        c.sampler.seek(Stream::Auxiliary, pair.number);
        const uint64_t trials = work.stats.trials;
        const double r =
            reciprocal_probability(c.scene, event, c.sampler, work.scratch, work.stats);
        if (connects_) {
            const double seen =
                double(luminance(*value)) / double(luminance(join->contribution) * pair.survival);
            observe(c, pair, *join, work.stats.trials - trials, r, seen, search, work);
        }
        c.sink.add(*join, *value * (float(r) * c.splat_scale / pair.survival));
    }

    /// Records a visible pair for later passes. `seen`: the transmittance of the join, divided by its survival probability
    /// in Russian roulette.
    void observe(const SampleContext& c, const GatherPair& pair, const Join& join, uint64_t trials,
                 double r, double seen, const GatherSearch& search, Workspace& work) const {
        GatherSums& sums = GatherSums::of(work);
        const bool is_fixed_by_film = work.z[pair.technique.t - 1].is_fixed_by_film;
        const double x = double(pair.unlimited_survival);
        if (is_fixed_by_film) GatherRadius::observe_trials(trials, x, sums);
        const float pixel = c.expected.at(work.z.film);
        if (!(pixel > 0)) return;
        const double weight_scale = double(learned_.weight_scale.value());
        const GatherMoment moment = GatherMoment::of(
            double(luminance(join.contribution) * search.scale() / pixel), double(join.mis_weight),
            weight_scale, double(join.pair_probability), r, seen);
        if (is_fixed_by_film) GatherRadius::observe(moment, x, weight_scale, sums);
        GatherWeightScale::observe(moment, sums);
    }

    /// Chooses the radius and the density of the first pass.
    void start(const PassContext& pass) {
        const PairPilot pilot = run_pair_pilot(pass, paths_, counts(pass.scene, pass.light_paths));
        GatherRadius radius;
        radius.start(given_radius_, connects_, seen_extent(pass.scene).radius,
                     pilot.pairs_per_radius2);
        density_ = PairDensity(pilot.vertices, radius.of(false), kGatherConstants.correlation,
                               pilot.multiple);
        learned_.radius = radius;
    }

    static constexpr uint64_t kVertexBytes = LightVertexCache::kVertexBytes +
                                             LightVertexGrid::kVertexBytes +
                                             LightVertexGrid::kBuiltVertexBytes;

    Bidirectional paths_;
    float given_radius_;
    bool connects_;
    LightPathOptions light_;
    TrialBound bound_;
    float flatness_;  ///< Half the height of a neighbourhood, divided by its radius.
    PairRule rule_;

    struct Learned {
        GatherRadius radius;
        GatherTotals gathers;
        GatherWeightScale weight_scale;
        NextEventCount next_events;
        GatherRoulette roulette;

        template <class State, class Use>
        static void for_each_field(State& learned, const Use& use) {
            auto& [radius, gathers, weight_scale, next_events, roulette] = learned;
            use(radius), use(gathers), use(weight_scale), use(next_events), use(roulette);
        }
    } learned_;
    PairDensity density_;
    CellCounts loaded_;  ///< The result of cells() until a pass has been made.

    // Of the pass.
    LightVertexCache cache_;
    LightVertexGrid inner_grid_;
    LightVertexGrid seen_grid_;  ///< Unused where both radii are equal.
};

std::vector<ParamInfo> upg_params(const std::vector<ParamInfo>& further = {}) {
    return concat(
        {Bidirectional::params(),
         {{"radius", ParamKind::Float, "0",
           "Largest distance between the vertices of a pair, in scene units. 0: automatic, about "
           "eight pairs for each eye path; upg+bdpt then adapts it during the rendering, and uses "
           "a smaller one behind the first diffuse or glossy vertex."}},
         LightPathOptions::params(),
         further,
         Guiding::params(),
         {{"bound", ParamKind::String, "slab",
           "Directions that Bernoulli trials propose: slab (pairs lie near the tangent plane), "
           "cone (in a ball) or box (in a ball; boxes of random numbers at diffuse vertices).",
           true},
          {"drop", ParamKind::String, "gloss",
           "Vertex of a pair that is dropped: gloss (the one sampled from the less "
           "glossy vertex), eye, light, or both (one path for each).",
           true}}});
}

}  // namespace

IntegratorEntry upg_entry() {
    return {{"integrator", "upg",
             "Unbiased photon gathering alone. Unbiased for the paths that it can make.",
             upg_params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgIntegrator>(p, false);
            }};
}

IntegratorEntry upg_bdpt_entry() {
    return {{"integrator", "upg+bdpt",
             "Unbiased photon gathering with bidirectional path tracing. Unbiased.",
             upg_params(concat({Specular::params(), Guiding::lights_params()}))},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgIntegrator>(p, true);
            }};
}

}  // namespace etendue
