// Unbiased photon gathering in Markov chains [Qin et al. 2015, §5]: pssmlt, with states that also gather from stored light
// paths.
//
// A state consists of the numbers of an eye and a light sub-path, as in pssmlt. Its eye sub-path also gathers from the light
// paths of the pass. The contributions of gathers are random given the state, since they need Bernoulli trials. The target
// is a fixed function of the state instead: the sum of the joins of the two sub-paths, and of the gathers without shadow
// rays and with the reciprocal probability of the disc. It depends on the light paths, so that the chains of each pass start
// anew: the mean over a pass is unbiased for any number of mutations after a start-up (chain_groups.h).

#include "integrator/upg_pssmlt.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/bdpt.h"
#include "integrator/light_path_options.h"
#include "integrator/markov.h"
#include "integrator/radius_params.h"
#include "integrator/seen_extent.h"
#include "math/hash.h"
#include "mcmc/whole_film.h"
#include "reuse/gather.h"
#include "reuse/gather_constants.h"

namespace etendue {
namespace {

/// Pairs per eye path for which the radius is chosen.
constexpr double kPairs = 2;
/// Weights count a light path as this part of a sample. Joins that the target contains contribute exactly in proportion to
/// it, whereas gathers add the noise of trials and of the light paths.
constexpr float kSample = 0.1f;
/// Russian roulette tests pairs below this part of the target of their state.
constexpr double kSmall = 0.3;

/// Purposes of random numbers of light paths.
enum Purpose : uint64_t { kRadius, kPass };

/// Light paths to gather from.
struct LightMap {
    static constexpr uint64_t kVertexBytes =
        LightVertexCache::kVertexBytes + LightVertexGrid::kVertexBytes;

    LightVertexCache cache;
    LightVertexGrid grid;
};

/// The parameters of sub-paths and gathers, which are fixed for the whole run.
struct Gathering {
    const Bidirectional& paths;
    uint64_t light_paths;  ///< Of a map.
    uint64_t max_bytes;    ///< Memory of a map.
    TechniqueCounts counts;
    PairDensity density{};
    GatherRoulette roulette{};  ///< None.

    /// `c` must have the number of light paths of the map.
    GatherSearch search(const SampleContext& c, const LightMap& map, Workspace& work) const {
        return {.c = c,
                .n = counts,
                .cache = map.cache,
                .seen_grid = map.grid,
                .inner_grid = map.grid,
                .density = density,
                .roulette = roulette,
                .max_depth = paths.max_depth(),
                .flatness = kGatherConstants.flatness,
                .threshold = 0,
                .work = work};
    }
    /// Calls use(t) for each eye vertex z_{t-1} that may belong to a pair.
    template <class Use>
    void for_each_place(const Workspace& work, const Use& use) const {
        for (int t = 2; t <= work.z.size(); ++t)
            if (paths.is_joinable(work.z, t)) use(t);
    }

    /// Traces N_L light paths, whose random numbers are functions of `key`.
    void trace(const PassContext& pass, uint64_t key, LightMap& map, float radius) const {
        constexpr uint64_t kChunk = 1024;
        const uint64_t chunks = (light_paths + kChunk - 1) / kChunk;
        map.cache.begin(chunks, LightMap::kVertexBytes, max_bytes);
        pass.for_each_other_path(chunks, [&](uint64_t chunk, Sampler&, Workspace& work) {
            Sampler sampler(SamplerKind::Independent, key);
            const WalkContext walk = paths.light_walk(pass.scene, counts, work.stats, &density);
            const uint64_t end = std::min(light_paths, (chunk + 1) * kChunk);
            for (uint64_t i = chunk * kChunk; i < end; ++i) {
                sampler.start(0, i);
                trace_light_path(walk, sampler, work.y);
                map.cache.add(chunk, work.y);
            }
        });
        map.cache.assemble();
        map.grid.build(map.cache, radius);
    }
};

class NoSink final : public ContributionSink {
    void add(const Join&, Rgb) override {}
};

/// Mean number of pairs per eye path.
double mean_pairs(const PassContext& pass, const Gathering& gathering, const LightMap& map,
                  uint64_t key) {
    constexpr uint64_t kPaths = 2048;
    std::vector<uint64_t> pairs(kPaths);
    pass.for_each_other_path(kPaths, [&](uint64_t i, Sampler&, Workspace& work) {
        const WholeFilm whole(pass);
        Sampler sampler(SamplerKind::Independent, key);
        sampler.start(0, i);
        NoSink sink;
        const SampleContext c =
            whole.sample.with(sampler, sink).with_light_paths(gathering.light_paths);
        trace_eye_path(
            gathering.paths.eye_walk(c.scene, gathering.counts, work.stats, &gathering.density), c,
            work.z);
        const uint64_t before = work.stats.pairs;
        const GatherSearch search = gathering.search(c, map, work);
        gathering.for_each_place(work,
                                 [&](int t) { search.for_each_pair(t, [](const GatherPair&) {}); });
        pairs[i] = work.stats.pairs - before;
    });
    uint64_t sum = 0;
    for (const uint64_t n : pairs) sum += n;
    return double(sum) / double(kPaths);
}

struct GatherState final : NumberState {
    double joined = 0;  ///< Part of the target that the joins of the two sub-paths have.
    /// Key of the random numbers of its gathers, on which the target does not depend.
    uint64_t trials = 0;

    void save(LearnedState& to) const override {
        NumberState::save(to);
        to.put(joined);
        to.put(trials);
    }
    void load(LearnedState& from) override {
        NumberState::load(from);
        from.get(joined);
        from.get(trials);
    }
};

class GatherSpace final : public PrimarySpace {
public:
    GatherSpace(const Gathering& gathering, const LightMap& light, const TargetMap& map)
        : PrimarySpace(
              1,
              [&gathering](int, const SampleContext& c, Workspace& work) {
                  add_bdpt_sample(gathering.paths, c, gathering.counts, work, &gathering.density);
              },
              map),
          gathering_(gathering), light_(light) {}

    std::unique_ptr<ChainState> make_state() const override {
        return std::make_unique<GatherState>();
    }
    void copy(const ChainState& from, ChainState& to) const override {
        static_cast<GatherState&>(to) = static_cast<const GatherState&>(from);
    }
    void repeat(int chain_class, const ChainState& x, const ChainContext& c,
                ContributionSink& sink) const override {
        PrimarySpace::repeat(chain_class, x, c, sink);
        gather(static_cast<const GatherState&>(x), c,
               [&](const Join& join, Rgb contribution) { sink.add(join, contribution); });
    }

protected:
    void evaluate(int chain_class, NumberSource& source, const ChainContext& c,
                  ChainState& state) const override {
        PrimarySpace::evaluate(chain_class, source, c, state);
        auto& y = static_cast<GatherState&>(state);
        y.joined = y.target;
        y.trials = source.key();
        const SubPath& z = c.work.z;
        Splat gathered{z.film, {}};
        y.target += gather(y, c, [&](const Join& join, Rgb contribution) {
            const Rgb value = contribution * (join.mis_weight * z.film_weight);
            if (is_finite(value))
                gathered.value += value;
            else
                ++c.work.stats.rejected;
        });
        if (luminance(gathered.value) > 0) y.splats.push_back(gathered);
        if (y.edges == 0 && y.target > 0) y.edges = MarkovIntegrator::kShortest;
    }

private:
    /// Gathers of the eye sub-path c.work.z of `state`. Calls add(join, contribution) for visible pairs. Returns the part of
    /// the target that the pairs have.
    template <class Add>
    double gather(const GatherState& state, const ChainContext& chain, const Add& add) const {
        Workspace& work = chain.work;
        Sampler trials(SamplerKind::Independent, state.trials);
        trials.start(0, 0);
        const SampleContext c =
            chain.sample.with(trials, chain.sample.sink).with_light_paths(gathering_.light_paths);
        const GatherSearch search = gathering_.search(c, light_, work);
        const double W = work.z.size() > 0 ? map()(work.z.film) : 0.0;
        double sum = 0;
        gathering_.for_each_place(work, [&](int t) {
            search.for_each_pair(t, [&](const GatherPair& pair) {
                const auto& [strategy, s, t_eye, drops_eye] = pair.technique;
                const auto join =
                    join_gather(c.scene, work.pair, s, work.z, t_eye, drops_eye, gathering_.counts);
                if (!join) return;
                const double part = W * double(luminance(join->contribution)) *
                                    double(join->mis_weight) * double(search.scale()) /
                                    double(join->pair_probability);
                if (!std::isfinite(part)) {
                    ++work.stats.rejected;
                    return;
                }
                sum += part;
                // Contributions that are small beside the target need not be precise.
                const auto value = Bidirectional::test_with_survival(
                    c, *join, float(part / (kSmall * (state.joined + sum))), pair.number, work);
                if (!value) return;
                ++work.stats.visible_pairs;
                PairEvent event = pair.event(work.pair, work.z);
                event.bound = TrialBound::Slab;
                trials.seek(Stream::Auxiliary, pair.number);
                const double r =
                    reciprocal_probability(c.scene, event, trials, work.scratch, work.stats);
                add(*join, *value * (float(r) * c.splat_scale));
            });
        });
        return sum;
    }

    const Gathering& gathering_;
    const LightMap& light_;
};

class UpgPssmltIntegrator final : public MarkovIntegrator {
public:
    explicit UpgPssmltIntegrator(const IntegratorParams& p)
        : MarkovIntegrator(p, DepthOptions::from(p), {.correlation = 10, .cost = 6}), light_(p),
          given_radius_(radius_param(p)) {
        options_.starts = Starts::EachPass;
    }

    uint64_t light_path_memory() const override { return light_.memory; }
    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n = MarkovIntegrator::counts(scene, light_paths);
        n.gather = kSample * float(gathered_ > 0 ? gathered_ : scene.film().pixel_count());
        n.pairs = {.disc = kPi * sqr(radius_),
                   .inner_disc = kPi * sqr(radius_),
                   .min_edges = kShortest,
                   .rule = PairRule::Gloss};
        return n;
    }
    std::unique_ptr<PassSums> make_sums() const override { return std::make_unique<GatherSums>(); }
    std::vector<std::pair<std::string, double>> figures() const override {
        auto out = MarkovIntegrator::figures();
        out.emplace_back("radius", radius_);
        return out;
    }

protected:
    /// Everything here is a function of the seed, so that a resumed rendering computes the same.
    Chains begin(const PassContext& pass, const Pilot& pilot) override {
        constexpr int kRounds = 3;
        use_roulette(pass.scene.film(), pilot);
        gathered_ = light_.count(pass.scene, paths_.depth(), LightMap::kVertexBytes);
        const float size = seen_extent(pass.scene).radius;
        const float largest = kGatherConstants.largest_radius * size;
        radius_ = given_radius_ > 0 ? given_radius_
                                    : std::min(largest, size / std::sqrt(float(gathered_)));
        for (int round = 0; round < kRounds; ++round) {
            gathering_.emplace(gathering(pass.scene));
            gathering_->trace(pass, key(pass, kRadius, uint64_t(round)), map_, radius_);
            if (given_radius_ > 0) break;
            const double pairs =
                mean_pairs(pass, *gathering_, map_, key(pass, kRadius, kRounds + uint64_t(round)));
            radius_ = std::min(
                largest,
                radius_ * float(std::clamp(std::sqrt(kPairs / (pairs + 1e-3)), 0.25, 4.0)));
        }
        const PairDensity density(map_.grid.points().counts(), radius_,
                                  kGatherConstants.correlation);
        gathering_.emplace(gathering(pass.scene));
        gathering_->density = density;

        const ClassPlan plan{.chains = options_.chains, .c = pilot.constant()};
        return {std::make_unique<GatherSpace>(*gathering_, map_, pilot.map),
                {plan},
                pool_samples(pilot.precise_samples, options_)};
    }

    void advance(const PassContext& pass, const StateSpace& space, ChainGroups& groups) override {
        gathering_->trace(pass, key(pass, kPass, pass.index), map_, radius_);
        MarkovIntegrator::advance(pass, space, groups);
    }

private:
    Gathering gathering(const Scene& scene) const {
        return {.paths = paths_,
                .light_paths = gathered_,
                .max_bytes = light_.memory,
                .counts = counts(scene, 0)};
    }
    static uint64_t key(const PassContext& pass, Purpose purpose, uint64_t number) {
        return hash_combine(hash_combine(hash_combine(pass.seed, 0x75706763), purpose), number);
    }

    LightPathOptions light_;
    uint64_t gathered_ = 0;  ///< Light paths of a map.
    float given_radius_;
    float radius_ = 0;
    std::optional<Gathering> gathering_;
    LightMap map_;  ///< Of the pass.
};

}  // namespace

IntegratorEntry upg_pssmlt_entry() {
    return {
        {"integrator", "upg+pssmlt",
         "Unbiased photon gathering combined with Markov chains in the primary sample space "
         "of bidirectional path tracing. Unbiased.",
         concat({sub_path_params(),
                 MarkovIntegrator::params(),
                 {{"light_paths", ParamKind::Int, "0",
                   "Number of light paths in a pass to gather from. 0: one for each pixel, or "
                   "as many as fit into `memory`."},
                  {"memory", ParamKind::Int, "6144", "Largest memory for light vertices, in MiB."},
                  {"radius", ParamKind::Float, "0",
                   "Largest distance between the vertices of a pair, in scene units; 0: chosen "
                   "so that an eye path finds about two pairs."}}})},
        [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
            return std::make_unique<UpgPssmltIntegrator>(p);
        }};
}

}  // namespace etendue
