// Unbiased photon gathering [Qin et al. 2015]: an eye vertex and a light vertex near it form a pair; one of the two is
// dropped, the other joined by a shadow ray, and Bernoulli trials estimate the reciprocal of the probability that the
// pair was found.
//
// Techniques: U(s,t), for paths of three edges and more; `upg+bdpt` has C(s,t) as well. Unbiased for the paths it can
// make, which for `upg` alone leaves out short ones and those where every vertex or its neighbours are delta events.

#include "integrator/upg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "integrator/gather.h"
#include "integrator/pair_count.h"
#include "integrator/pair_worth.h"
#include "integrator/photon_memory.h"

namespace etendue {
namespace {

/// Of neighbourhoods, with the bound `slab`: what trials aim at is flat then, and nearly all of it is met where the
/// surface is smooth.
constexpr float kFlatness = 0.02f;

/// Of the default radius: pairs of an eye path, and its largest share of the radius of the scene's bounds.
constexpr double kPairs = 8;
constexpr float kLargest = 0.02f;

constexpr std::array<Choice<TrialBound>, 3> kBounds{
    {{"box", TrialBound::Box}, {"cone", TrialBound::Cone}, {"slab", TrialBound::Slab}}};
constexpr std::array<Choice<PairRule>, 4> kRules{{{"gloss", PairRule::Gloss},
                                                  {"eye", PairRule::Eye},
                                                  {"light", PairRule::Light},
                                                  {"both", PairRule::Both}}};

class UpgIntegrator final : public Integrator {
public:
    UpgIntegrator(const IntegratorParams& p, bool connects)
        : paths_(p), radius_(p.number("radius")), connects_(connects), memory_(photon_memory(p)),
          bound_(p.choice("bound", kBounds)),
          flatness_(bound_ == TrialBound::Slab ? kFlatness : 1.0f), rule_(p.choice("drop", kRules)),
          short_rate_(p.number("short_rate")), clamps_(p.flag("clamp")) {
        if (!(radius_ >= 0))
            throw std::runtime_error(
                fmt::format("{}: radius must not be negative", p.integrator()));
        if (!(short_rate_ >= 0 && short_rate_ <= 1))
            throw std::runtime_error(
                fmt::format("{}: short_rate must lie in [0, 1]", p.integrator()));
    }

    void begin_pass(const PassContext& pass) override {
        paths_.begin_pass(pass);
        if (connects_) count_.begin_pass(pass.so_far);
        worth_.begin_pass(pass.so_far);
        learns_count_ = connects_ && pass.index > 0;  // the first pass's weights know of no density
        const float radius = radius_ > 0 ? radius_ : radius_for(pass);
        photons_.learn_density(radius);
        photons_.trace(pass, paths_, counts(pass.scene, pass.light_paths, radius), radius, memory_);
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths, photons_.radius());
        if (connects_) photons_.paths().restore(c.scene, c.pixel, work.y);
        const auto by_trials = [&](PairEvent event, const Join& j, float seen) {
            event.bound = bound_;
            const double r =
                reciprocal_probability(c.scene, event, c.sampler, work.scratch, work.stats);
            const float pixel = c.film.expected_luminance(c.pixel);
            if (learns_count_ && pixel > 0) {
                const float brought =
                    luminance(j.contribution) * std::fabs(work.z.film_weight) * c.splat_scale;
                count_.observe(double(brought / pixel), double(j.mis_weight), double(j.found), r,
                               double(seen), work.stats);
            }
            return r;
        };
        const Gather gather{c, paths_, photons_, worth_, n, flatness_, paths_.threshold(c), work};
        paths_.eye_path(c, n, work, [&](int t) {
            paths_.add_next_event(c, n, t, work);
            paths_.connect_to_own(c, n, t, work);
            gather(t, by_trials);
            return Onward::ByAnyEvent;
        });
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return counts(scene, light_paths, photons_.radius());
    }
    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override { return Estimator::Unbiased; }
    std::vector<std::pair<std::string, double>> figures() const override {
        return {{"radius", photons_.radius()}, {"pair_count", connects_ ? count_.value() : 1}};
    }

private:
    /// Such that an eye path finds kPairs pairs, as far as the last pass tells. A pass knows of earlier ones only, so that
    /// its image has the right expectation whatever they found.
    float radius_for(const PassContext& pass) {
        const float size = pass.scene.bounds().radius(), largest = kLargest * size;
        if (pass.index == 0) return std::min(largest, size / std::sqrt(float(pass.light_paths)));
        const double pairs = double(pass.so_far.pairs - pairs_so_far_),
                     paths = double(pass.so_far.eye_paths - eye_paths_so_far_);
        pairs_so_far_ = pass.so_far.pairs;
        eye_paths_so_far_ = pass.so_far.eye_paths;
        const double factor = std::clamp(std::sqrt(kPairs * paths / (pairs + 1)), 0.5, 2.0);
        return std::min(largest, photons_.radius() * float(factor));
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths, float radius) const {
        const float N = float(light_paths);
        TechniqueCounts n;
        if (connects_) {
            n.hit = n.next_event = n.connect = 1;
            n.splat = N;
            n.hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f;
        }
        n.gather = connects_ ? N * count_.value() : N;
        n.disc = kPi * radius * radius;
        n.min_pair_edges = 3;
        n.short_pair_rate = short_rate_;
        n.pair_rule = rule_;
        n.clamps_disc = clamps_;
        n.density = &photons_.density();
        return n;
    }

    Bidirectional paths_;
    uint64_t pairs_so_far_ = 0, eye_paths_so_far_ = 0;
    float radius_;
    bool connects_;
    uint64_t memory_;
    TrialBound bound_;
    float flatness_;  ///< Half the height of a neighbourhood over its radius.
    PairRule rule_;
    float short_rate_;
    bool clamps_;
    bool learns_count_ = false;
    Photons photons_;
    PairCount count_;
    PairWorth worth_;
};

std::vector<ParamInfo> params() {
    std::vector<ParamInfo> params = Bidirectional::params();
    params.push_back(
        {"radius", ParamKind::Float, "0",
         "Distance within which vertices form pairs, in scene units; 0: chosen by what earlier "
         "passes found, such that an eye path finds about eight."});
    params.push_back(memory_param());
    params.push_back(
        {"bound", ParamKind::String, "slab",
         "Directions that Bernoulli trials propose: slab (partners lie near the "
         "tangent plane), cone (in a ball), or box (in a ball; boxes of random numbers "
         "at diffuse vertices)."});
    params.push_back({"drop", ParamKind::String, "gloss",
                      "Which vertex of a pair is dropped: gloss (that sampled from the less glossy "
                      "vertex), eye, light, or both, for a path each."});
    params.push_back({"short_rate", ParamKind::Float, "1",
                      "Share of the pairs that are used for paths of three edges."});
    params.push_back({"clamp", ParamKind::Bool, "true",
                      "Whether weights take the probability of a pair for at most 1."});
    return params;
}

}  // namespace

IntegratorEntry upg_entry() {
    return {{"integrator", "upg",
             "Unbiased photon gathering alone. Unbiased for the paths it can make.", params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgIntegrator>(p, false);
            }};
}

IntegratorEntry upg_bdpt_entry() {
    return {{"integrator", "upg+bdpt",
             "Unbiased photon gathering with bidirectional path tracing. Unbiased.", params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<UpgIntegrator>(p, true);
            }};
}

}  // namespace etendue
