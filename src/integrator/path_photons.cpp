// A state is a path x_0 … x_k with photons at some of its vertices. Let x_i be one of them. The part of the target for this
// photon is
//     lum(f_map) q a,    a = min(1, h/h_0) but at least 0.05,    h = lum(f) / (lum(f_map) q),
// with the flux f_map of x_0 … x_i, the contribution f of the path to the image, and the density q of the remainder
// x_{i+1} … x_k given x_0 … x_i. A photon of the global map is met by gather rays from D, the first diffuse vertex from
// the eye. q is the even mixture of two ways to sample its remainder:
// - from x_i by the BSDF, over vertices that are not diffuse, to D, which is joined to the lens;
// - from a film point, over vertices that are not diffuse, to D, which is joined to x_i.
// The remainder of a photon of the caustic map is a point on the lens.
//
// The power of a photon is (b/N) f_map/lum(f_map) r. Trials sample remainders from q until one succeeds with probability
// a, and r is their number, so that E[r] is the reciprocal of the probability of success. It is independent of
// the remainder of the state. Photons at the same x_0 … x_i therefore have the same expected power for every remainder.

#include "integrator/path_photons.h"

#include <algorithm>
#include <cmath>

#include "math/hash.h"
#include "math/statistics.h"
#include "mcmc/addresses.h"
#include "mcmc/path_space.h"
#include "sampler/pilot_seed.h"

namespace etendue {
namespace {

constexpr int kShortest = 3;
/// Largest number of edges of a remainder. Paths between mirrors may otherwise never end.
constexpr int kLongestRemainder = 64;

/// A photon that a path stores at x_i.
struct Deposit {
    int i;
    MapPhoton::Origin origin;
    bool is_caustic;        ///< Whether it is in the caustic map; otherwise in the global map.
    PathProduct flux;       ///< f_map
    PathDensity unclamped;  ///< lum(f_map) q
    double h;

    bool is_same(const Deposit& o) const { return i == o.i && is_caustic == o.is_caustic; }
};

/// Computes the photons of paths.
class PathPhotonRule {
public:
    PathPhotonRule(const PhotonMapping& mapping, const PathMeasure& measure)
        : mapping_(mapping), measure_(measure) {}

    /// h_0 by map; 0: no clamp.
    std::array<double, 2> h0{};

    bool is_diffuse(const Vertex& v) const { return mapping_.is_diffuse(v); }
    /// a = min(1, h/h_0), but not below kLeast: any function of the path will do that is positive where f is, and a small
    /// one costs many trials.
    double clamped(const Deposit& d) const {
        constexpr double kLeast = 0.05;
        const double limit = h0[d.is_caustic];
        return limit > 0 ? std::clamp(d.h / limit, kLeast, 1.0) : 1.0;
    }

    template <class Use>
    void for_each_deposit(const PathState& x, const Use& use) const {
        if (!measure_.film.contains(x.film)) return;
        const int k = x.last();
        const PathDensity f = luminance(x.contribution());
        if (!(f > 0)) return;
        const auto diffuse = [this](const Vertex& v) { return is_diffuse(v); };
        const int D = x.before(k, diffuse);
        // The first vertex from which only vertices that are not diffuse lead to D.
        const int first = x.before(D, diffuse);
        PhotonOrigins origins(mapping_, x[0].v);
        const auto add = [&](int i, MapPhoton::Origin origin, bool is_caustic, PathDensity q) {
            if (!(q > 0)) return;
            Deposit d{.i = i,
                      .origin = origin,
                      .is_caustic = is_caustic,
                      .flux = x.flux(i),
                      .unclamped = 0,
                      .h = 0};
            d.unclamped = luminance(d.flux) * q;
            d.h = double(f / d.unclamped);
            if (d.unclamped > 0) use(d);
        };
        for (int i = 1; i < k; ++i) {
            const auto origin = origins.next(x[i].v);
            if (!origin || k - i > kLongestRemainder) continue;
            if (i == k - 1 && *origin != MapPhoton::Origin::Any && !x[i].v.is_delta)
                add(i, *origin, true, x.eye(k));
            if (i >= first && i < D && !x[D].v.is_delta) add(i, *origin, false, gathered(x, i, D));
        }
    }

    MapPhoton photon(const PathState& x, const Deposit& d, double power) const {
        const Vertex& v = x[d.i].v;
        const Vec3 wi = direction(v, x[d.i - 1].v);
        const PathDensity Y = luminance(d.flux);
        const Rgb colour(float(d.flux[0] / Y), float(d.flux[1] / Y), float(d.flux[2] / Y));
        return {
            {v.p, wi, colour * float(power), &x.emitter(), d.i + 1}, d.origin, arrival_side(v, wi)};
    }

    /// Makes z from x_0 … x_i and a sampled remainder, and returns the probability that this trial succeeds.
    double trial(const PathState& x, const Deposit& at, const ChainContext& c, Sampler& sampler,
                 PathState& z) const {
        PathBuilder builder(measure_, sampler, c.work, &x, at.i, x.last() + 1);
        if (!at.is_caustic && !sample_remainder(builder, sampler)) return 0;
        if (!builder.finish(z)) return 0;
        double p = 0;
        for_each_deposit(z, [&](const Deposit& d) {
            if (d.is_same(at)) p = clamped(d);
        });
        return p;
    }

private:
    /// q of a photon at x_i for the global map, where D has the index d.
    static PathDensity gathered(const PathState& x, int i, int d) {
        const int k = x.last();
        PathDensity by_light = 0, by_eye = 0;
        if (d == k - 1) {
            by_light = x.eye(k);
            for (int j = i + 1; j < k; ++j) by_light *= x.light(j);
        }
        if (d == i + 1 && !x[i].v.is_delta) {
            by_eye = 1;
            for (int j = i + 1; j <= k; ++j) by_eye *= x.eye(j);
        }
        return (by_light + by_eye) / 2;
    }

    bool sample_remainder(PathBuilder& builder, Sampler& sampler) const {
        sampler.seek(Stream::Selection, addresses::kKind);
        if (sampler.next_1d() < 0.5f) {
            for (int n = 0; n < kLongestRemainder; ++n) {
                if (!builder.sample_light_step()) return false;
                if (is_diffuse(builder.light_end())) return true;
            }
            return false;
        }
        if (!builder.start_eye_anywhere()) return false;
        for (int n = 0; n < kLongestRemainder; ++n) {
            if (builder.eye_end().kind != Vertex::Kind::Surface) return false;
            if (is_diffuse(builder.eye_end())) return true;
            if (!builder.sample_eye_step()) return false;
        }
        return false;
    }

    const PhotonMapping& mapping_;
    const PathMeasure& measure_;
};

class PathDeposits final : public PhotonDeposits {
public:
    PathDeposits(const PathPhotonRule& rule, const StateSpace& space, bool has_finite_lens,
                 const Terms& terms, const ChainContext& c)
        : PhotonDeposits(terms), rule_(rule), has_finite_lens_(has_finite_lens), c_(c),
          trial_(space.make_state()) {}

protected:
    void deposit(const ChainState& state, double factor, double, uint64_t key) override {
        const auto& x = static_cast<const PathState&>(state);
        rule_.for_each_deposit(x, [&](const Deposit& d) {
            const double part = double(d.unclamped * rule_.clamped(d) / x.large_step_density());
            const MapPhoton photon = rule_.photon(x, d, factor * part);
            MapPhoton powered = photon;
            powered.power *= float(reciprocal(x, d, photon, hash_combine(key, 1 + uint64_t(d.i))));
            store(powered, {!d.is_caustic, d.is_caustic});
        });
    }

private:
    /// Estimates 1/P. All states of the chain with this x_0 … x_i have the same estimate.
    double reciprocal(const PathState& x, const Deposit& d, const MapPhoton& photon, uint64_t key) {
        // Through a pinhole there is only one remainder.
        if (d.is_caustic && !has_finite_lens_) return 1 / rule_.clamped(d);
        // P depends on the colour of the flux.
        const uint64_t place =
            hash_combine(hash_combine(place_key(photon), d.is_caustic), hash_of(d.flux));
        const auto [at, is_new] = reciprocals_.try_emplace(place, 0.0);
        if (is_new) at->second = count_trials(x, d, key);
        return at->second;
    }

    double count_trials(const PathState& x, const Deposit& d, uint64_t key) {
        constexpr uint64_t kRunaway = 10'000'000;
        auto& z = static_cast<PathState&>(*trial_);
        Sampler sampler(SamplerKind::Independent, key);
        ++out().reciprocals;
        for (uint64_t n = 1; n <= kRunaway; ++n) {
            sampler.start(n);
            ++out().trials;
            const double p = rule_.trial(x, d, c_, sampler, z);
            if (!(p > 0)) continue;
            sampler.seek(Stream::Auxiliary, 0);
            if (sampler.next_1d_unstructured() < p) return double(n);
        }
        ++c_.work.stats.runaways;
        return double(kRunaway);
    }

    const PathPhotonRule& rule_;
    bool has_finite_lens_;
    ChainContext c_;
    std::unique_ptr<ChainState> trial_;
    std::unordered_map<uint64_t, double> reciprocals_;
};

class PathPhotons final : public PhotonStates {
public:
    PathPhotons(const PassContext& context, const PhotonMapping& mapping,
                const PathMeasure& measure, const std::optional<UserPaths>& user_paths,
                double user_share)
        : measure_(measure), rule_(mapping, measure_) {
        // Mutations of the eye's side have small weights, because they store few new photons.
        mutations_.weights[PathMutations::Bidirectional] = 3;
        for (const auto kind :
             {PathMutations::Lens, PathMutations::Caustic, PathMutations::MultiChain,
              PathMutations::GlossyLens, PathMutations::GlossyCaustic, PathMutations::LensSubpath})
            mutations_.weights[kind] = 1;
        mutations_.weights[PathMutations::Manifold] = 0;  // keeps the light side
        mutations_.weights[PathMutations::PhotonMap] = 2;
        if (user_paths) {
            user_ = {*user_paths, user_share};
            mutations_.weights[PathMutations::UserPath] =
                user_share / (1 - user_share) * mutations_.weights[PathMutations::Bidirectional];
        }
        make_space({});
        make_space(learn(context));
    }

    const StateSpace& space() const override { return *space_; }
    std::unique_ptr<PhotonDeposits> deposits(const PhotonDeposits::Terms& terms,
                                             const ChainContext& c) const override {
        return std::make_unique<PathDeposits>(rule_, *space_,
                                              measure_.scene.sensor().has_finite_lens(), terms, c);
    }

private:
    void make_space(const TechniqueLight& light) {
        constexpr int kTabulated = 24;
        techniques_.emplace(measure_.scene, kShortest,
                            std::min(kTabulated, measure_.longest - kShortest + 1), light);
        const auto importance = [this](const PathState& x, Rgb) {
            PathDensity sum = 0;
            rule_.for_each_deposit(
                x, [&](const Deposit& d) { sum += d.unclamped * rule_.clamped(d); });
            return double(sum / x.large_step_density());
        };
        const auto stores = [this](const Vertex& v) {
            return v.kind == Vertex::Kind::Surface && v.is_connectible && rule_.is_diffuse(v);
        };
        space_.emplace(PathTarget{measure_, importance,
                                  LengthChoice(kShortest, measure_.longest, light), *techniques_,
                                  user_, stores},
                       mutations_, TechniqueCounts{});
    }

    /// Sets h_0 to the medians of h over the remainders of photons, in proportion to flux, and returns the light of each
    /// length and technique.
    TechniqueLight learn(const PassContext& context) {
        constexpr uint64_t kSamples = 16384;
        struct Sample {
            std::vector<std::pair<Deposit, double>> deposits;  ///< With weights lum(f_map) q/T.
            int k = 0;
            std::vector<double> shares;  ///< By technique.
        };
        std::vector<Sample> samples(kSamples);
        for_each_independent(context, kSamples, [&](uint64_t i, const ChainContext& c) {
            const auto state = space_->make_state();
            space_->draw(0, hash_combine(pilot_seed(context.seed, PilotUse::PhotonPaths), i), c,
                         *state);
            if (!(state->target > 0)) return;
            const auto& x = static_cast<const PathState&>(*state);
            Sample& sample = samples[i];
            const int k = sample.k = x.last();
            rule_.for_each_deposit(x, [&](const Deposit& d) {
                sample.deposits.push_back({d, double(d.unclamped / x.large_step_density())});
            });
            double sum = 0;
            for (int s = 0; s <= k + 1; ++s) {
                const double pmf = techniques_->pmf(k, s);
                sum += sample.shares.emplace_back(
                    pmf > 0 ? double(pmf * x.density(s) / x.large_step_density()) : 0.0);
            }
            for (double& share : sample.shares) share /= sum;
        });
        std::array<std::vector<WeightedValue>, 2> responses;
        for (const Sample& s : samples)
            for (const auto& [d, weight] : s.deposits)
                responses[d.is_caustic].push_back({d.h, weight});
        rule_.h0 = {weighted_median(std::move(responses[0])),
                    weighted_median(std::move(responses[1]))};
        TechniqueLight light;
        for (const Sample& sample : samples)
            for (const auto& [d, weight] : sample.deposits)
                for (int s = 0; s <= sample.k + 1; ++s)
                    light[{sample.k, s}] += weight * rule_.clamped(d) * sample.shares[size_t(s)];
        return light;
    }

    PathMeasure measure_;
    PathPhotonRule rule_;
    PathMutations mutations_;
    UserSteps user_;
    std::optional<TechniqueChoice> techniques_;
    std::optional<PathSpace> space_;
};

}  // namespace

std::unique_ptr<PhotonStates> path_photons(const PassContext& context, const PhotonMapping& mapping,
                                           const std::optional<UserPaths>& user_paths,
                                           double user_share) {
    const int longest = mapping.paths().max_depth();
    if (longest < kShortest) return nullptr;
    const PathMeasure measure(context.scene,
                              reached_region(context.film.geometry(), context.film.filter()),
                              kShortest, longest);
    return std::make_unique<PathPhotons>(context, mapping, measure, user_paths, user_share);
}

}  // namespace etendue
