#include "integrator/metropolis_photons.h"

#include <algorithm>
#include <cmath>

#include "integrator/path_photons.h"
#include "integrator/seen_extent.h"
#include "math/hash.h"
#include "math/statistics.h"
#include "mcmc/addresses.h"
#include "mcmc/primary_space.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

/// Purposes of the random numbers of this source.
enum Purpose : uint64_t { kChains = 0x6d7075, kDeposits };

/// A vertex at which a state may store a photon.
struct Candidate {
    MapPhoton photon;  ///< Its power is F, without the factor r.
    Maps maps;
    double part;  ///< Its part of the target.
};

struct PhotonState : NumberState {
    std::vector<Candidate> candidates;
};

/// A state consists of the numbers of a light path. It stores a photon at one of its diffuse vertices, chosen in proportion
/// to flux times importance.
///
/// With user paths, one number decides whether the light path follows one of them or is traced in the usual way. Both
/// ways can make the same path, so its flux is divided by the sum of both densities [Fan et al. 2005, eq. 7].
class ImportonSpace final : public NumberSpace {
public:
    /// Successive states are to store photons at different places: their steps are wider than those of chains on images.
    explicit ImportonSpace(const PhotonMapping& mapping)
        : NumberSpace(1, NumberStep::Wide, 0.1), mapping_(mapping) {}

    const PhotonImportance* importance = nullptr;
    const UserPaths* user_paths = nullptr;
    double user_share = 0;  ///< Probability that a light path follows a user path.

    std::unique_ptr<ChainState> make_state() const override {
        return std::make_unique<PhotonState>();
    }
    void copy(const ChainState& from, ChainState& to) const override {
        static_cast<PhotonState&>(to) = static_cast<const PhotonState&>(from);
    }
    /// No joins: photons are no contributions to the film.
    void repeat(int, const ChainState&, const ChainContext&, ContributionSink&) const override {}

    /// Traces work.y with independent numbers, without user paths.
    void draw_light_path(uint64_t key, const ChainContext& c) const {
        NumberTable numbers;
        NumberSource source(NumberStep::Fresh, key, nullptr, &numbers);
        Sampler sampler(source);
        trace_light_path(light_walk(c), sampler, c.work.y);
    }

protected:
    void evaluate(int, NumberSource& source, const ChainContext& c, ChainState& y) const override {
        auto& state = static_cast<PhotonState&>(y);
        state.candidates.clear();
        Sampler sampler(source);
        trace(c, sampler);
        std::vector<double> ratios;
        if (user_paths) user_paths->density_ratios(c.work.y, ratios);
        // Density of a traced path over that of the mixture, for the path up to vertex i.
        const auto share = [&](int i) {
            return user_paths ? 1 / (1 - user_share + user_share * ratios[size_t(i)]) : 1.0;
        };
        for_each_photon(mapping_, c.work.y, [&](MapPhoton photon) {
            photon.power *= float(share(photon.s - 1));
            const double part = double(luminance(photon.power)) * double((*importance)(photon));
            if (!is_finite(photon.power) || !std::isfinite(part))
                ++c.work.stats.rejected;
            else if (part > 0)
                state.candidates.push_back({photon, {true, photon.is_caustic()}, part});
        });
        state.target = 0;
        state.edges = 0;
        double largest = 0;
        for (const Candidate& k : state.candidates) {
            state.target += k.part;
            if (k.part > largest) largest = k.part, state.edges = k.photon.s - 1;
        }
    }

private:
    WalkContext light_walk(const ChainContext& c) const {
        static constexpr TechniqueCounts kNone;
        WalkContext walk = mapping_.paths().light_walk(c.sample.scene, kNone, c.work.stats);
        if (user_paths)
            walk.options.rr_depth = std::max(walk.options.rr_depth, user_paths->longest() - 1);
        return walk;
    }
    /// Traces work.y, which may follow a user path and then continues in the usual way.
    void trace(const ChainContext& c, Sampler& sampler) const {
        const WalkContext walk = light_walk(c);
        SubPath& y = c.work.y;
        if (user_paths) {
            sampler.seek(Stream::Selection, addresses::kFollowsUserPath);
            if (double(sampler.next_1d()) < user_share) {
                bool goes_on = user_paths->sample(walk, sampler, y);
                while (goes_on) goes_on = extend<TransportMode::Importance>(walk, sampler, y);
                return;
            }
        }
        trace_light_path(walk, sampler, y);
    }

    const PhotonMapping& mapping_;
};

class ImportonDeposits final : public PhotonDeposits {
public:
    using PhotonDeposits::PhotonDeposits;

protected:
    void deposit(const ChainState& chain_state, double factor, double steps,
                 uint64_t key) override {
        const auto& state = static_cast<const PhotonState&>(chain_state);
        // A state that stays for several steps stores photons at several of its vertices.
        const size_t count = size_t(std::clamp(std::lround(steps), 1L, 64L));
        parts_.clear();
        for (const Candidate& k : state.candidates) parts_.push_back(k.part);
        const std::vector<size_t> chosen =
            resample(parts_, count, to_unit_double(hash_combine(key, 2)));
        for (size_t i = 0; i < chosen.size();) {
            size_t end = i;
            while (end < chosen.size() && chosen[end] == chosen[i]) ++end;
            const Candidate& k = state.candidates[chosen[i]];
            const double times = double(end - i) / double(count) * state.target / k.part;
            MapPhoton photon = k.photon;
            photon.power *= float(factor * times);
            store(photon, k.maps);
            i = end;
        }
    }

private:
    std::vector<double> parts_;
};

class ImportonStates final : public PhotonStates {
public:
    explicit ImportonStates(const PhotonMapping& mapping) : space_(mapping) {}
    ImportonSpace& importon_space() { return space_; }
    const StateSpace& space() const override { return space_; }
    std::unique_ptr<PhotonDeposits> deposits(const PhotonDeposits::Terms& terms,
                                             const ChainContext&) const override {
        return std::make_unique<ImportonDeposits>(terms);
    }

private:
    ImportonSpace space_;
};

constexpr uint64_t kScaleSamples = 4096;

/// The constant that is added to the importance, a fraction of its mean over the flux of photons, so that every density
/// estimate finds photons.
float importance_floor(const PassContext& context, const PhotonMapping& mapping,
                       const ImportonSpace& space, const PhotonImportance& density) {
    constexpr double kShareOfMean = 0.02;
    std::vector<std::array<double, 2>> sums(kScaleSamples);
    for_each_independent(context, kScaleSamples, [&](uint64_t i, const ChainContext& c) {
        space.draw_light_path(hash_combine(pilot_seed(context.seed, PilotUse::PhotonScale), i), c);
        sums[i] = {};
        for_each_photon(mapping, c.work.y, [&](const MapPhoton& photon) {
            const double flux = double(luminance(photon.power)),
                         important = flux * double(density(photon));
            if (!std::isfinite(important)) {
                ++c.work.stats.rejected;
                return;
            }
            sums[i][0] += flux;
            sums[i][1] += important;
        });
    });
    double flux = 0, important = 0;
    for (const auto& s : sums) flux += s[0], important += s[1];
    return important > 0 ? float(kShareOfMean * important / flux) : 1.0f;
}

}  // namespace

MetropolisPhotons::MetropolisPhotons(const PhotonMapping& mapping,
                                     const MetropolisPhotonOptions& options)
    : mapping_(mapping), options_(options) {}

MetropolisPhotons::~MetropolisPhotons() = default;

MetropolisPhotons::Pilot MetropolisPhotons::run_pilot(const PassContext& context,
                                                      const StateSpace& space) const {
    constexpr uint64_t kFewest = 4096, kMost = uint64_t(1) << 20;
    // A lower precision than that of the pool suffices.
    const double precision = 2 * options_.precision;
    const uint64_t key = pilot_seed(context.seed, PilotUse::PhotonPilot);
    std::vector<double> targets;
    while (true) {
        const uint64_t done = targets.size();
        targets.resize(std::max(kFewest, 2 * done));
        for_each_independent(context, targets.size() - done,
                             [&](uint64_t i, const ChainContext& c) {
                                 const auto state = space.make_state();
                                 space.draw(0, hash_combine(key, done + i), c, *state);
                                 targets[done + i] = state->target;
                             });
        Moments m;
        for (const double t : targets) m.add(t);
        Pilot pilot{.b = m.mean(), .samples = targets.size()};
        if (pilot.b > 0) pilot.relative_variance = m.variance() / sqr(pilot.b);
        const double needed = pilot.relative_variance / sqr(precision);
        if (pilot.samples >= kMost || (pilot.b > 0 && double(pilot.samples) >= needed))
            return pilot;
    }
}

std::unique_ptr<PhotonStates>
MetropolisPhotons::make_states(const PassContext& context,
                               const std::function<std::vector<Importon>()>& importons) {
    constexpr float kRadius = 0.03f;  // Of what is seen.
    if (options_.target == PhotonTarget::Path)
        return path_photons(context, mapping_, user_paths_, options_.user_share);
    auto states = std::make_unique<ImportonStates>(mapping_);
    ImportonSpace& space = states->importon_space();
    importance_.emplace(importons(), kRadius * seen_extent(context.scene).radius);
    importance_->set_floor(importance_floor(context, mapping_, space, *importance_));
    space.importance = &*importance_;
    if (user_paths_) {
        space.user_paths = &*user_paths_;
        space.user_share = options_.user_share;
    }
    return states;
}

MapPhotons MetropolisPhotons::trace(const PassContext& context, uint32_t pass,
                                    const std::function<std::vector<Importon>()>& importons) {
    MapPhotons photons;
    photons_ = reciprocals_ = trials_ = pool_ = 0;
    b_ = 0;
    stats_ = {};
    if (!context.scene.has_emitters()) return photons;
    if (!options_.user_paths.empty() && !user_paths_)
        user_paths_ = UserPaths::load(context.scene, options_.user_paths);
    if (!states_) {
        std::unique_ptr<PhotonStates> states = make_states(context, importons);
        if (!states) return photons;
        pilot_ = run_pilot(context, states->space());
        states_ = std::move(states);
        // Of what an earlier part of the rendering has counted.
        if (context.film.passes() > 0) context.forget_statistics();
    }
    const StateSpace& space = states_->space();
    if (!(pilot_.b > 0)) return photons;

    constexpr double kMostPool = double(1 << 24);
    pool_ =
        std::max(uint64_t(4 * options_.chains),
                 uint64_t(std::min(kMostPool, pilot_.relative_variance / sqr(options_.precision))));
    const ChainOptions chains{.groups = 1,
                              .chains = options_.chains,
                              .p_large = options_.p_large,
                              .starts = Starts::Once,
                              .pool = pool_};
    ChainGroups groups(space, chains, {{.chains = options_.chains, .c = pilot_.b}});
    PassContext own = context;
    own.index = 0;
    own.seed = hash_combine(hash_combine(context.seed, kChains), pass);
    own.pixels = options_.mutations;
    own.light_paths = 1;

    PhotonMemory memory(options_.max_bytes);
    std::vector<PhotonDeposits::Result> results(size_t(options_.chains));
    const double unit = pilot_.b / double(options_.mutations);
    groups.advance(
        own,
        [&](uint64_t chain, int, const ChainContext& c, SplatSink&) -> std::unique_ptr<StateSink> {
            return states_->deposits({.unit = unit,
                                      .least_share = options_.least_share,
                                      .key = hash_combine(hash_combine(own.seed, kDeposits), chain),
                                      .memory = memory,
                                      .out = results[chain]},
                                     c);
        });
    groups.commit();
    b_ = groups.b();
    stats_ = groups.stats();
    for (const auto& r : results) {
        photons.global.insert(photons.global.end(), r.photons.global.begin(),
                              r.photons.global.end());
        photons.caustic.insert(photons.caustic.end(), r.photons.caustic.begin(),
                               r.photons.caustic.end());
        reciprocals_ += r.reciprocals;
        trials_ += r.trials;
    }
    photons_ = photons.global.size() + photons.caustic.size();
    return photons;
}

Figures MetropolisPhotons::figures() const {
    Figures out{{"photons", double(photons_)},
                {"normalisation", b_},
                {"normalisation_relative_error",
                 pool_ > 0 ? std::sqrt(pilot_.relative_variance / double(pool_)) : 0.0},
                {"pilot_samples", double(pilot_.samples)},
                {"pool_samples", double(pool_)},
                {"longest_stay", double(stats_.longest_stay)}};
    if (options_.target == PhotonTarget::Path)
        out.push_back(
            {"trials_per_photon", reciprocals_ > 0 ? double(trials_) / double(reciprocals_) : 0.0});
    if (states_) add_step_figures(stats_, states_->space().mutations(), 1, out);
    return out;
}

}  // namespace etendue
