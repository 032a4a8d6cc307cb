// Unbiased photon gathering in Markov chains [Qin et al. 2015, §5]: pssmlt, with states that also gather from stored light
// paths.
//
// A state consists of the numbers of an eye and a light sub-path, as in pssmlt. Its target is the sum of the joins of the
// two and of the gathers of its eye sub-path from a light map that is traced once, before the chains start. For the target,
// gathers use no shadow rays, and the reciprocal probability of the disc instead of trials. A constant is added wherever
// there may be a pair, so that the target is positive there. For the image, gathers use shadow rays and trials, and another
// map, which every pass traces anew. Given the state, these have the correct mean for any target. If the target depended on
// the map of the pass, each map would need its own target and its own b.

#include "integrator/upg_pssmlt.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/light_path_options.h"
#include "integrator/markov.h"
#include "math/hash.h"
#include "mcmc/whole_film.h"
#include "reuse/gather.h"
#include "reuse/gather_constants.h"

namespace etendue {
namespace {

/// Fraction of b that is added to the target of every state that may form pairs.
constexpr double kFloor = 0.05;

/// Purposes of random numbers of light paths.
enum Purpose : uint64_t { kRadius, kFrozen, kFresh, kTrials };

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
        return {c,
                counts,
                map.cache,
                map.grid,
                map.grid,
                density,
                roulette,
                paths.max_depth(),
                kGatherConstants.flatness,
                0,
                work};
    }
    /// Calls use(t) for each eye vertex z_{t-1} that may belong to a pair.
    template <class Use>
    void for_each_place(const Workspace& work, const Use& use) const {
        for (int t = 2; t <= work.z.size(); ++t)
            if (paths.is_joinable(work.z, t)) use(t);
    }
    void trace_eye_path(const SampleContext& c, Workspace& work) const {
        paths.trace_eye_path(c, counts, work, &density);
    }
    /// The same with the numbers of a state.
    void repeat_eye_path(const NumberState& state, const ChainContext& c,
                         ContributionSink& sink) const {
        NumberSource numbers(NumberStep::Same, 0, &state.numbers, nullptr);
        Sampler sampler(numbers);
        trace_eye_path(c.sample.with(sampler, sink), c.work);
    }
    /// Joins of bidirectional path tracing.
    void add_sample(const SampleContext& c, Workspace& work) const {
        paths.trace_light_path(c, counts, work, &density);
        paths.add_eye_path(c, counts, work, &density,
                           [&](int t) { paths.add_connections(c, counts, t, work); });
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
        gathering.trace_eye_path(c, work);
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

class GatherSpace final : public PrimarySpace {
public:
    GatherSpace(const Gathering& gathering, const LightMap& frozen, const TargetMap& map,
                double floor)
        : PrimarySpace(
              1,
              [&gathering](int, const SampleContext& c, Workspace& work) {
                  gathering.add_sample(c, work);
              },
              map),
          gathering_(gathering), frozen_(frozen), floor_(floor) {}

protected:
    void evaluate(int chain_class, NumberSource& source, const ChainContext& c,
                  ChainState& y) const override {
        PrimarySpace::evaluate(chain_class, source, c, y);
        const SampleContext of_map = c.sample.with_light_paths(gathering_.light_paths);
        const GatherSearch search = gathering_.search(of_map, frozen_, c.work);
        const double W = c.work.z.size() > 0 ? map()(c.work.z.film) : 0.0;
        bool has_place = false;
        gathering_.for_each_place(c.work, [&](int t) {
            has_place = true;
            search.for_each_pair(t, [&](const GatherPair& pair) {
                const auto& [strategy, s, t_eye, drops_eye] = pair.technique;
                const auto join = join_gather(c.sample.scene, c.work.pair, s, c.work.z, t_eye,
                                              drops_eye, gathering_.counts);
                if (!join) return;
                const double value = double(luminance(join->contribution)) *
                                     double(join->mis_weight) * double(search.scale()) /
                                     double(join->pair_probability);
                if (std::isfinite(value)) y.target += W * value;
            });
        });
        if (has_place) y.target += floor_;
        if (y.edges == 0 && y.target > 0) y.edges = MarkovIntegrator::kShortest;
    }

private:
    const Gathering& gathering_;
    const LightMap& frozen_;
    double floor_;
};

/// Adds the states of a chain to the film, with their gathers from the map of the pass.
class GatheringStates final : public StateSink {
public:
    GatheringStates(const StateSpace& space, const Gathering& gathering, const LightMap& fresh,
                    uint64_t key, const ChainContext& c, SplatSink& film)
        : space_(space), gathering_(gathering), fresh_(fresh), key_(key), c_(c), film_(film) {}

    void add(const ChainState& state, double factor) override {
        space_.contribute(0, state, factor, c_, film_);
        Workspace& work = c_.work;
        NoSink none;
        gathering_.repeat_eye_path(static_cast<const NumberState&>(state), c_, none);
        Sampler trials(SamplerKind::Independent, hash_combine(key_, states_++));
        trials.start(0, 0);
        const SampleContext c =
            c_.sample.with(trials, none).with_light_paths(gathering_.light_paths);
        const GatherSearch search = gathering_.search(c, fresh_, work);
        gathering_.for_each_place(work, [&](int t) {
            search.for_each_pair(t, [&](const GatherPair& pair) { add(c, pair, factor, trials); });
        });
    }

private:
    void add(const SampleContext& c, const GatherPair& pair, double factor, Sampler& trials) {
        Workspace& work = c_.work;
        const auto& [strategy, s, t, drops_eye] = pair.technique;
        const auto join =
            join_gather(c.scene, work.pair, s, work.z, t, drops_eye, gathering_.counts);
        if (!join) return;
        const float Tr = visibility(c.scene, *join, work.stats);
        if (!(Tr > 0)) return;
        ++work.stats.visible_pairs;
        PairEvent event = pair.event(work.pair, work.z);
        event.bound = TrialBound::Slab;
        trials.seek(Stream::Auxiliary, pair.number);
        const double r = reciprocal_probability(c.scene, event, trials, work.scratch, work.stats);
        const Rgb contribution = join->contribution * (Tr * float(r) * c.splat_scale);
        const Rgb value = contribution * (join->mis_weight * work.z.film_weight * float(factor));
        if (!is_finite(value)) {
            ++work.stats.rejected;
            return;
        }
        if (work.is_observed) film_.tell(*join, contribution, float(factor) * work.z.film_weight);
        film_.add(work.z.film, value);
    }

    const StateSpace& space_;
    const Gathering& gathering_;
    const LightMap& fresh_;
    uint64_t key_, states_ = 0;
    ChainContext c_;
    SplatSink& film_;
};

class UpgPssmltIntegrator final : public MarkovIntegrator {
public:
    explicit UpgPssmltIntegrator(const IntegratorParams& p)
        : MarkovIntegrator(p, DepthOptions::from(p), {.correlation = 10, .cost = 6}), light_(p),
          given_radius_(p.number("radius")) {
        if (!(given_radius_ >= 0))
            throw std::runtime_error(
                fmt::format("{}: radius must not be negative", p.integrator()));
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n = MarkovIntegrator::counts(scene, light_paths);
        n.gather = float(gathered_ > 0 ? gathered_ : scene.film().pixel_count());
        n.pairs = {.disc = kPi * sqr(radius_),
                   .inner_disc = kPi * sqr(radius_),
                   .min_edges = kShortest,
                   .short_rate = 1,
                   .rule = PairRule::Gloss,
                   .clamps = true};
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
        use_roulette(pilot);
        gathered_ = light_.count(pass.scene, paths_.depth(), kMaps * LightMap::kVertexBytes);
        const float size = pass.scene.bounds().is_empty() ? 1 : pass.scene.bounds().radius();
        const float largest = kGatherConstants.largest_radius * size;
        radius_ = given_radius_ > 0 ? given_radius_
                                    : std::min(largest, size / std::sqrt(float(gathered_)));
        for (int round = 0; round < kRounds; ++round) {
            gathering_.emplace(gathering(pass.scene));
            gathering_->trace(pass, key(pass, kRadius, uint64_t(round)), frozen_, radius_);
            if (given_radius_ > 0) break;
            const double pairs = mean_pairs(pass, *gathering_, frozen_,
                                            key(pass, kRadius, kRounds + uint64_t(round)));
            radius_ = std::min(
                largest,
                radius_ * float(std::clamp(std::sqrt(kGatherConstants.pairs / (pairs + 1e-3)), 0.25,
                                           4.0)));
        }
        const PairDensity density(frozen_.grid.points().counts(), radius_,
                                  kGatherConstants.correlation);
        gathering_.emplace(gathering(pass.scene));
        gathering_->density = density;
        gathering_->trace(pass, key(pass, kFrozen, 0), frozen_, radius_);

        const ClassPlan plan{.chains = options_.chains,
                             .pool = pool_samples(pilot.precise_samples, options_),
                             .c = pilot.b};
        return {std::make_unique<GatherSpace>(*gathering_, frozen_, pilot.map, kFloor * pilot.b),
                {plan}};
    }

    void advance(const PassContext& pass, const StateSpace& space, ChainGroups& groups) override {
        gathering_->trace(pass, key(pass, kFresh, pass.index), fresh_, radius_);
        const uint64_t trials = key(pass, kTrials, pass.index);
        groups.advance(pass, [&](uint64_t chain, int, const ChainContext& c, SplatSink& film) {
            return std::make_unique<GatheringStates>(space, *gathering_, fresh_,
                                                     hash_combine(trials, chain), c, film);
        });
    }

private:
    static constexpr uint64_t kMaps = 2;

    Gathering gathering(const Scene& scene) const {
        return {.paths = paths_,
                .light_paths = gathered_,
                .max_bytes = light_.memory / kMaps,
                .counts = counts(scene, 0)};
    }

    LightPathOptions light_;
    uint64_t gathered_ = 0;  ///< Light paths of a map.
    static uint64_t key(const PassContext& pass, Purpose purpose, uint64_t number) {
        return hash_combine(hash_combine(hash_combine(pass.seed, 0x75706763), purpose), number);
    }

    float given_radius_;
    float radius_ = 0;
    std::optional<Gathering> gathering_;
    LightMap frozen_, fresh_;
};

}  // namespace

IntegratorEntry upg_pssmlt_entry() {
    std::vector<ParamInfo> params = sub_path_params();
    for (const ParamInfo& p : MarkovIntegrator::params()) params.push_back(p);
    params.push_back(
        {"light_paths", ParamKind::Int, "0",
         "Number of light paths in a pass to gather from. 0: one for each pixel, or as "
         "many as fit into `memory`."});
    params.push_back({"memory", ParamKind::Int, "6144",
                      "Largest memory for light vertices, in MiB; those to gather from in a pass "
                      "and those that the chains know take half of it each."});
    params.push_back({"radius", ParamKind::Float, "0",
                      "Largest distance between the vertices of a pair, in scene units; 0: chosen "
                      "so that an eye path finds about eight pairs."});
    return {{"integrator", "upg+pssmlt",
             "Unbiased photon gathering combined with Markov chains in the primary sample space "
             "of bidirectional path tracing. Unbiased.",
             params},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgPssmltIntegrator>(p);
            }};
}

}  // namespace etendue
