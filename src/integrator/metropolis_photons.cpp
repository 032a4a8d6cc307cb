#include "integrator/metropolis_photons.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "math/hash.h"
#include "math/statistics.h"
#include "mcmc/primary_space.h"
#include "mcmc/whole_film.h"

namespace etendue {
namespace {

/// Purposes of the random numbers of this source.
enum Purpose : uint64_t { kScale = 0x6d7073, kPilot, kChains, kDeposits };

/// Vertices of Stream::Selection in states: the first two with target Path, the third one with user paths.
enum PathNumber : uint64_t { kStoragePoint, kRemainder, kFollowsUserPath };

/// The maps that store a photon.
struct Maps {
    bool global, caustic;
};

/// A vertex at which a state may store a photon.
struct Candidate {
    MapPhoton photon;  ///< Its power is F, without the factor r.
    Maps maps;
    double part;  ///< Its part of the target.
};

struct PhotonState : NumberState {
    std::vector<Candidate> candidates;
};

/// Response of the lens to a remainder: luminance in the image per unit of flux at the storage point. 0: there is none.
struct Response {
    double value = 0;
    int last =
        0;  ///< Index of the last vertex of the light path that belongs to the path to the lens.
};

/// The rest of a path from its storage point y_i to the lens. A photon of the global map is met by gather rays from a first
/// diffuse vertex D. The rest is drawn in one of two ways: from the storage point by the BSDF, over surfaces that are not
/// diffuse, to D, which is joined to the lens; or from a film point, over surfaces that are not diffuse, to D, which is joined
/// to y_i. That of a photon of the caustic map is one join of y_i to the lens.
struct StoragePoint {
    int i;
    bool is_caustic;
};

/// The value of a remainder for PhotonTarget::Path: its response divided by h_0, and at most 1. Any function in [0, 1] that
/// depends only on the path and is fixed before the chains start would be correct.
struct Clamp {
    double gathered = 0, caustic = 0;  ///< h_0: the value is 1 for responses of at least h_0.
    double operator()(const StoragePoint& at, double response) const {
        const double h0 = at.is_caustic ? caustic : gathered;
        return h0 > 0 ? std::min(1.0, response / h0) : double(response > 0);
    }
};

}  // namespace

/// A state consists of the numbers of a light path. With the target Importons, it stores a photon at one of its diffuse
/// vertices, chosen in proportion to flux times importance. With the target Path, another number chooses this vertex, and
/// further numbers determine the remainder of the path to the lens.
///
/// With user paths, one number decides whether the light path follows one of them or is traced in the usual way. Both
/// ways can make the same path, so its flux is divided by the sum of both densities [Fan et al. 2005, eq. 7].
class PhotonSpace final : public NumberSpace {
public:
    PhotonSpace(const PhotonMapping& mapping, const FilmGeometry& geometry,
                const ReconstructionFilter& filter)
        : NumberSpace(1), mapping_(mapping), region_(reached_region(geometry, filter)) {}

    const PhotonImportance* importance = nullptr;  ///< For the target Importons.
    Clamp clamp;                                   ///< For the target Path.
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

    std::vector<StoragePoint> storage_points(const SubPath& y) const {
        std::vector<StoragePoint> points;
        for_each_photon(mapping_, y, [&](const MapPhoton& photon) {
            points.push_back({photon.s - 1, false});
            if (photon.is_caustic()) points.push_back({photon.s - 1, true});
        });
        return points;
    }

    /// The response to a remainder that is drawn with the numbers of `sampler`. The remainder follows work.y beyond the
    /// storage point as far as it was traced, and then extends it.
    Response response(const ChainContext& c, Sampler& sampler, const StoragePoint& at,
                      bool extends) const {
        SubPath& y = c.work.y;
        const double flux = double(luminance(y[at.i].beta));
        if (at.is_caustic) return {join_to_lens(c, sampler, at.i) / flux, at.i};
        sampler.seek(Stream::Selection, kRemainder);
        if (sampler.next_1d() < 0.5f) {
            if (extends) y.truncate(at.i + 1);
            const WalkContext walk = light_walk(c);
            for (int i = at.i + 1;; ++i) {
                if (i >= y.size() &&
                    !(extends && extend<TransportMode::Importance>(walk, sampler, y)))
                    return {};
                if (mapping_.is_diffuse(y[i])) return {join_to_lens(c, sampler, i) / flux, i};
            }
        }
        const TechniqueCounts counts{.connect = 1};
        const WalkContext walk = mapping_.paths().eye_walk(c.sample.scene, counts, c.work.stats);
        SubPath& z = c.work.z;
        sampler.seek(Stream::Eye, 0);
        const Film::PixelSample film = c.sample.film_sample(sampler.next_2d());
        start_eye_path(walk, film, sampler.next_2d(), sampler, z);
        for (int t = 2; t <= z.size(); ++t) {
            if (z[t - 1].kind != Vertex::Kind::Surface) return {};
            if (mapping_.takes_photons(z, t)) {
                const auto join = join_connect(c.sample.scene, y, at.i + 1, z, t, counts);
                if (!join) return {};
                return {seen(c, *join) * double(std::fabs(z.film_weight)) / flux, at.i};
            }
            if (!extend<TransportMode::Radiance>(walk, sampler, z)) return {};
        }
        return {};
    }

    /// Estimates 1/P, where P is the probability that trials of remainders succeed; counts them.
    double reciprocal(const PhotonState& state, uint64_t key, const ChainContext& c,
                      uint64_t& trials) const {
        constexpr uint64_t kRetrace = 1024, kRunaway = 10'000'000;
        const StoragePoint at{state.candidates[0].photon.s - 1, state.candidates[0].maps.caustic};
        Sampler sampler(SamplerKind::Independent, key);
        for (uint64_t n = 1; n <= kRunaway; ++n) {
            // Again from time to time, since the memory of vertices that were dropped is kept until then.
            if (n % kRetrace == 1) {
                NumberSource source(NumberStep::Same, 0, &state.numbers, nullptr);
                Sampler of_state(source);
                trace(c, of_state);
            }
            sampler.start(n);
            ++trials;
            const double a = clamp(at, response(c, sampler, at, true).value);
            sampler.seek(Stream::Auxiliary, 0);
            if (sampler.next_1d_unstructured() < a) return double(n);
        }
        ++c.work.stats.runaways;
        return double(kRunaway);
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
        if (importance)
            add_importon_candidates(c.work.y, share, state);
        else
            add_path_candidate(c, sampler, share, state);
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
            sampler.seek(Stream::Selection, kFollowsUserPath);
            if (double(sampler.next_1d()) < user_share) {
                bool goes_on = user_paths->sample(walk, sampler, y);
                while (goes_on) goes_on = extend<TransportMode::Importance>(walk, sampler, y);
                return;
            }
        }
        trace_light_path(walk, sampler, y);
    }

    template <class Share>
    void add_importon_candidates(const SubPath& y, const Share& share, PhotonState& state) const {
        for_each_photon(mapping_, y, [&](MapPhoton photon) {
            photon.power *= float(share(photon.s - 1));
            const double part = double(luminance(photon.power)) * double((*importance)(photon));
            if (part > 0 && is_finite(photon.power))
                state.candidates.push_back({photon, {true, photon.is_caustic()}, part});
        });
    }

    template <class Share>
    void add_path_candidate(const ChainContext& c, Sampler& sampler, const Share& share,
                            PhotonState& state) const {
        const std::vector<StoragePoint> points = storage_points(c.work.y);
        if (points.empty()) return;
        const double n = double(points.size());
        sampler.seek(Stream::Selection, kStoragePoint);
        const size_t chosen = std::min(size_t(sampler.next_1d_fine() * n), points.size() - 1);
        const StoragePoint at = points[chosen];
        const Response seen = response(c, sampler, at, false);
        const double a = clamp(at, seen.value);
        if (!(a > 0)) return;
        const double factor = n * a * share(seen.last);
        for_each_photon(mapping_, c.work.y, [&](MapPhoton photon) {
            if (photon.s - 1 != at.i) return;
            photon.power *= float(factor);
            const double part = double(luminance(photon.power));
            if (part > 0 && is_finite(photon.power))
                state.candidates.push_back({photon, {!at.is_caustic, at.is_caustic}, part});
        });
    }

    double join_to_lens(const ChainContext& c, Sampler& sampler, int i) const {
        const TechniqueCounts counts{.splat = 1};
        const auto join = join_splat(c.sample.scene, c.work.y, i + 1, sampler, counts);
        return join && region_.contains(join->film) ? seen(c, *join) : 0.0;
    }
    static double seen(const ChainContext& c, const Join& join) {
        const double value = double(luminance(join.contribution));
        if (!(value > 0) || !std::isfinite(value)) return 0;
        return value * double(visibility(c.sample.scene, join, c.work.stats));
    }

    const PhotonMapping& mapping_;
    FilmRegion region_;
};

namespace {

/// Makes photons from the states of one chain.
class PhotonDeposits final : public StateSink {
public:
    struct Result {
        MapPhotons photons;
        uint64_t deposits = 0, trials = 0;
    };

    /// `unit`: factor times target of a state that stays for one step.
    PhotonDeposits(const PhotonSpace& space, double unit, double least_share, uint64_t key,
                   const ChainContext& c, PhotonMemory& memory, Result& out)
        : space_(space), unit_(unit), least_(least_share), key_(key), c_(c), memory_(memory),
          out_(out) {}

    void add(const ChainState& chain_state, double factor) override {
        const auto& state = static_cast<const PhotonState&>(chain_state);
        const uint64_t key = hash_combine(key_, number_++);
        // A few photons of equal power give less noise than many photons of small power.
        const double share = factor * state.target / unit_;
        if (share < least_) {
            if (!(to_unit_double(hash_combine(key, 0)) * least_ < share)) return;
            factor *= least_ / share;
        }
        ++out_.deposits;
        if (!space_.importance)
            factor *= space_.reciprocal(state, hash_combine(key, 1), c_, out_.trials);
        // A state that stays for several steps stores photons at several of its vertices.
        const size_t count = size_t(std::clamp(std::lround(share), 1L, 64L));
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
            bool is_new = k.maps.global && global_.store(photon, out_.photons.global);
            if (k.maps.caustic) is_new |= caustic_.store(photon, out_.photons.caustic);
            if (is_new) memory_.add(1);
            i = end;
        }
    }

private:
    /// Photons of a chain in a map. Where a proposal is rejected, or keeps the beginning of the path, a photon comes
    /// again: its power is added to the one that is stored [Fan et al. 2005, §3.2]. Otherwise all photons of a density
    /// estimate could be at one point.
    class Repeats {
    public:
        /// Whether the photon is a new one.
        bool store(const MapPhoton& photon, std::vector<MapPhoton>& map) {
            uint64_t key = uint64_t(photon.s);
            for (const float x : {photon.p.x, photon.p.y, photon.p.z, photon.wi.x, photon.wi.y})
                key = hash_combine(key, std::bit_cast<uint32_t>(x));
            const auto [at, is_new] = places_.try_emplace(key, map.size());
            if (is_new)
                map.push_back(photon);
            else
                map[at->second].power += photon.power;
            return is_new;
        }

    private:
        std::unordered_map<uint64_t, size_t> places_;  ///< Indices in the map.
    };

    const PhotonSpace& space_;
    double unit_, least_;
    uint64_t key_, number_ = 0;
    ChainContext c_;
    PhotonMemory& memory_;
    Result& out_;
    Repeats global_, caustic_;
    std::vector<double> parts_;
};

/// Calls use(i, c) for independent samples in parallel.
template <class Use>
void for_each_independent(const PassContext& context, uint64_t count, const Use& use) {
    context.for_each_other_path(count, [&](uint64_t i, Sampler&, Workspace& work) {
        const WholeFilm whole(context);
        use(i, ChainContext{whole.sample, work});
    });
}

constexpr uint64_t kScaleSamples = 4096;

/// The constant that is added to the importance, a fraction of its mean over the flux of photons, so that every density
/// estimate finds photons.
float importance_floor(const PassContext& context, const PhotonMapping& mapping,
                       const PhotonSpace& space, const PhotonImportance& density) {
    constexpr double kShareOfMean = 0.02;
    std::vector<std::array<double, 2>> sums(kScaleSamples);
    for_each_independent(context, kScaleSamples, [&](uint64_t i, const ChainContext& c) {
        space.draw_light_path(hash_combine(hash_combine(context.seed, kScale), i), c);
        sums[i] = {};
        for_each_photon(mapping, c.work.y, [&](const MapPhoton& photon) {
            const double flux = double(luminance(photon.power));
            sums[i][0] += flux;
            sums[i][1] += flux * double(density(photon));
        });
    });
    double flux = 0, important = 0;
    for (const auto& s : sums) flux += s[0], important += s[1];
    return important > 0 ? float(kShareOfMean * important / flux) : 1.0f;
}

double median(std::vector<double> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// h_0: medians of the responses that are not 0.
Clamp median_responses(const PassContext& context, const PhotonSpace& space) {
    std::vector<std::array<double, 2>> values(kScaleSamples);
    for_each_independent(context, kScaleSamples, [&](uint64_t i, const ChainContext& c) {
        const uint64_t key = hash_combine(hash_combine(context.seed, kScale), i);
        values[i] = {};
        Sampler sampler(SamplerKind::Independent, key);
        for (const bool is_caustic : {false, true}) {
            space.draw_light_path(key, c);
            std::vector<StoragePoint> points = space.storage_points(c.work.y);
            std::erase_if(points,
                          [&](const StoragePoint& p) { return p.is_caustic != is_caustic; });
            if (points.empty()) continue;
            sampler.start(is_caustic);
            const size_t chosen =
                std::min(size_t(to_unit_double(hash_combine(key, 3)) * double(points.size())),
                         points.size() - 1);
            values[i][is_caustic] = space.response(c, sampler, points[chosen], true).value;
        }
    });
    std::array<std::vector<double>, 2> positive;
    for (const auto& v : values)
        for (size_t k = 0; k < 2; ++k)
            if (v[k] > 0) positive[k].push_back(v[k]);
    return {.gathered = median(positive[0]), .caustic = median(positive[1])};
}

}  // namespace

MetropolisPhotons::MetropolisPhotons(const PhotonMapping& mapping,
                                     const MetropolisPhotonOptions& options)
    : mapping_(mapping), options_(options) {}

MetropolisPhotons::~MetropolisPhotons() = default;

MetropolisPhotons::Pilot MetropolisPhotons::run_pilot(const PassContext& context,
                                                      const PhotonSpace& space) const {
    constexpr uint64_t kFewest = 4096, kMost = uint64_t(1) << 20;
    // A lower precision than that of the pool suffices.
    const double precision = 2 * options_.precision;
    const uint64_t key = hash_combine(context.seed, kPilot);
    std::vector<double> targets;
    while (true) {
        const uint64_t done = targets.size();
        targets.resize(std::max(kFewest, 2 * done));
        for_each_independent(context, targets.size() - done,
                             [&](uint64_t i, const ChainContext& c) {
                                 const auto state = space.make_state();
                                 space.draw(0, hash_combine(key, done + i), c, *state);
                                 targets[done + i] = state->importance();
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

MapPhotons MetropolisPhotons::trace(const PassContext& context, uint32_t pass,
                                    const std::function<std::vector<Importon>()>& importons) {
    constexpr float kRadius = 0.03f;  // Of the scene's.
    MapPhotons photons;
    photons_ = deposits_ = trials_ = pool_ = 0;
    b_ = 0;
    stats_ = {};
    if (!context.scene.has_emitters()) return photons;

    PhotonSpace space(mapping_, context.film.geometry(), context.film.filter());
    if (options_.target == PhotonTarget::Importons) {
        if (!importance_) {
            PhotonImportance density(importons(), kRadius * context.scene.bounds().radius());
            density.set_floor(importance_floor(context, mapping_, space, density));
            importance_ = std::move(density);
        }
        space.importance = &*importance_;
    } else {
        space.clamp = median_responses(context, space);
    }
    if (!options_.user_paths.empty()) {
        if (!user_paths_) user_paths_ = UserPaths::load(context.scene, options_.user_paths);
        space.user_paths = &*user_paths_;
        space.user_share = options_.user_share;
    }
    pilot_ = run_pilot(context, space);
    if (!(pilot_.b > 0)) return photons;

    constexpr double kMostPool = double(1 << 24);
    pool_ =
        std::max(uint64_t(4 * options_.chains),
                 uint64_t(std::min(kMostPool, pilot_.relative_variance / sqr(options_.precision))));
    const ChainOptions chains{.groups = 1, .chains = options_.chains, .p_large = options_.p_large};
    ChainGroups groups(space, chains, {{.chains = options_.chains, .pool = pool_, .c = pilot_.b}});
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
            const uint64_t key = hash_combine(hash_combine(own.seed, kDeposits), chain);
            return std::make_unique<PhotonDeposits>(space, unit, options_.least_share, key, c,
                                                    memory, results[chain]);
        });
    groups.commit();
    b_ = groups.b();
    stats_ = groups.stats();
    for (const auto& r : results) {
        photons.global.insert(photons.global.end(), r.photons.global.begin(),
                              r.photons.global.end());
        photons.caustic.insert(photons.caustic.end(), r.photons.caustic.begin(),
                               r.photons.caustic.end());
        deposits_ += r.deposits;
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
            {"trials_per_photon", deposits_ > 0 ? double(trials_) / double(deposits_) : 0.0});
    add_step_figures(stats_, NumberSpace::kMutations, 1, out);
    return out;
}

}  // namespace etendue
