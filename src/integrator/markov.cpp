#include "integrator/markov.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "integrator/bdpt.h"

namespace etendue {
namespace {

/// Largest rr_depth of samples in which chains find their first states.
constexpr int kFindingRoulette = 2;
/// Longest time of the mutations of a pass, relative to that of its samples of direct light.
constexpr double kLongest = 8;

}  // namespace

std::vector<ParamInfo> MarkovIntegrator::params() {
    return {
        {"p_large", ParamKind::Float, "0.1",
         "Probability of a large step, in [0.01, 1]. Large steps also serve as independent "
         "samples of the image."},
        {"mutations", ParamKind::Float, "0",
         "Number of mutations per pixel and pass, up to 1024; a pass also makes one independent "
         "sample of direct light per pixel. 0: chosen by the noise of both."},
        {"chains", ParamKind::Int, "256",
         "Number of chains in each group; it does not depend on the number of threads."},
        {"groups", ParamKind::Int, "16",
         "Number of independent groups of chains, an even number from 2 to 1024. The groups "
         "take turns, one per pass; the error is estimated from their differences once each "
         "has had a pass."}};
}

MarkovIntegrator::MarkovIntegrator(const IntegratorParams& p, const DepthOptions& depth,
                                   StepWorth worth, Guiding guiding)
    : options_{.groups = p.integer("groups", 2, 1024),
               .chains = p.integer("chains", 1, 1 << 20),
               .p_large = double(p.number("p_large", 0.01f, 1.0f)),
               .mutations = double(p.number("mutations", 0.0f, 1024.0f))},
      paths_(depth, kShortest), worth_(worth), guiding_(std::move(guiding)),
      direct_({std::min(depth.max_depth, kShortest - 1), depth.rr_depth}, 1),
      pilot_paths_(pilot_depth(depth), kShortest),
      finding_paths_({depth.max_depth, std::min(depth.rr_depth, kFindingRoulette)}, kShortest) {
    if (options_.groups % 2 != 0)
        throw std::runtime_error(
            fmt::format("{}: groups must be even, but is {}", p.integrator(), options_.groups));
}

uint64_t MarkovIntegrator::whole_film_paths(const Scene& scene) {
    return std::max(uint64_t(1),
                    uint64_t(std::llround(reached_region(scene.film(), scene.filter()).area())));
}

TechniqueCounts MarkovIntegrator::guided_counts(const Scene& scene) const {
    // Of bidirectional path tracing alone; the counts of derived classes may depend on an earlier begin().
    TechniqueCounts n = MarkovIntegrator::counts(scene, 0);
    if (guiding_.guides_walks()) n.guide = guiding_.guide();
    return n;
}

PrimarySample MarkovIntegrator::bidirectional_sample(const Bidirectional& paths,
                                                     const TechniqueCounts& n) {
    return [&paths, n](int, const SampleContext& c, Workspace& work) {
        add_bdpt_sample(paths, c, n, work);
    };
}

namespace {

/// Of the luminance of a join, by pixel: that of a part of the typical target of a state.
std::vector<float> thresholds(const FilmGeometry& film, const Pilot& pilot) {
    constexpr double kSmall = 0.1;
    std::vector<float> out(film.pixel_count());
    for (uint64_t i = 0; i < out.size(); ++i)
        out[i] = float(kSmall * pilot.typical / pilot.map(film.pixel_center(i)));
    return out;
}

}  // namespace

void MarkovIntegrator::use_roulette(const FilmGeometry& film, const Pilot& pilot) {
    paths_.set_roulette(thresholds(film, pilot));
}

WeighedSample MarkovIntegrator::samples_of_paths(const Scene& scene, const Pilot& pilot) {
    finding_paths_.set_roulette(thresholds(scene.film(), pilot));
    return {bidirectional_sample(finding_paths_, guided_counts(scene)), pilot.map};
}

void MarkovIntegrator::trace(const PassContext& pass) {
    if (paths_.max_depth() < kShortest || !pass.scene.has_emitters()) return;
    const bool is_loaded = !loaded_.empty();
    if (!has_begun_) {
        if (!is_loaded) {
            guiding_.train(pass, MarkovIntegrator::counts(pass.scene, 0), pilot_paths_.depth(),
                           GuidedWalks::Both, GuidedLight::Indirect);
            set_direct_guide();
            const TechniqueCounts n = guided_direct_counts(pass.scene, pass.light_paths);
            pilot_ = run_pilot(pass, bidirectional_sample(pilot_paths_, guided_counts(pass.scene)),
                               [&](int, const SampleContext& c, Workspace& work) {
                                   add_bdpt_sample(direct_, c, n, work);
                               });
            if (guiding_.guides_walks() && !guides_large_steps()) {
                const TechniqueCounts unguided = MarkovIntegrator::counts(pass.scene, 0);
                pilot_->by_unguided_technique =
                    unguided_light(pass, bidirectional_sample(pilot_paths_, unguided), *pilot_);
            }
        }
        Chains chains = begin(pass, *pilot_);
        pool_ = chains.pool;
        groups_.reset();
        space_ = std::move(chains.space);
        ChainOptions options = options_;
        options.mutations = mutations_per_pixel();
        options.pool = chains.pool;
        options.later = chains.later;
        options.large_step = chains.large_step;
        groups_ = std::make_unique<ChainGroups>(*space_, options, std::move(chains.plan));
    }
    if (is_loaded) {
        // Kept until all of it is loaded: a checkpoint after a failure must have it, too.
        LearnedState state(loaded_);
        groups_->load(state);
        loaded_ = {};
        has_begun_ = true;
        pass.forget_statistics();
    }
    advance(pass, *space_, *groups_);
}

double MarkovIntegrator::mutations_per_pixel() const {
    if (options_.mutations > 0) return options_.mutations;
    // With M mutations for each sample of direct light, the product of variance and time is
    // (V_d + V_c/M) (T_d + M T_c). It is least for M² = V_c T_d / (V_d T_c).
    const double V_c = worth_.correlation * pilot_->chain_variance, V_d = pilot_->direct_variance,
                 most = std::max(1.0, kLongest / worth_.cost);
    if (!(V_c < sqr(most) * V_d * worth_.cost)) return most;
    return std::max(1.0, std::sqrt(V_c / (V_d * worth_.cost)));
}

void MarkovIntegrator::save(LearnedState& to) const {
    const bool has_chains = has_begun_ || !loaded_.empty();
    to.put(has_chains);
    if (!has_chains) return;
    guiding_.save(to);
    pilot_->save(to);
    if (!has_begun_) {
        to.put(loaded_);
        return;
    }
    LearnedState groups;
    groups_->save(groups);
    to.put(groups.bytes());
}

void MarkovIntegrator::load(LearnedState& from) {
    bool has_chains = false;
    from.get(has_chains);
    if (!has_chains) return;
    guiding_.load(from);
    set_direct_guide();
    pilot_.emplace();
    pilot_->load(from);
    from.get(loaded_);
}

TechniqueCounts MarkovIntegrator::direct_counts(const Scene& scene, uint64_t light_paths) {
    return scene.has_delta_emitters() ? Bidirectional::counts(scene, light_paths)
                                      : TechniqueCounts{.hit = 1, .next_event = 1};
}

TechniqueCounts MarkovIntegrator::guided_direct_counts(const Scene& scene,
                                                       uint64_t light_paths) const {
    TechniqueCounts n = direct_counts(scene, light_paths);
    if (direct_guide_) n.guide = &*direct_guide_;
    return n;
}

void MarkovIntegrator::set_direct_guide() {
    direct_guide_.reset();
    const Guide* guide = guiding_.guide();
    if (guide && !guide->lights.is_empty()) direct_guide_.emplace().lights = guide->lights;
}

void MarkovIntegrator::trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                                       RenderStats& stats) const {
    direct_.trace_eye_paths(c, guided_direct_counts(c[0].scene, c[0].light_paths), z, stats);
}

void MarkovIntegrator::sample(const SampleContext& c, Workspace& work) const {
    add_bdpt_joins(direct_, c, guided_direct_counts(c.scene, c.light_paths), work);
}

std::vector<std::pair<std::string, double>> MarkovIntegrator::figures() const {
    if (!groups_) return {};
    std::vector<std::pair<std::string, double>> out{
        {"normalisation", groups_->b()},
        {"normalisation_relative_error", groups_->relative_error_of_b()},
        {"pilot_samples", pilot_->samples},
        {"pool_samples", pool_},
        {"later_samples", groups_->stats().later_samples},
        {"mutations_per_pixel", mutations_per_pixel()},
        {"longest_stay", groups_->stats().longest_stay}};
    guiding_.add_figures(out);
    add_step_figures(groups_->stats(), space_->mutations(), kShortest, out);
    return out;
}

void add_step_figures(const ChainStats& stats, std::span<const char* const> mutations, int shortest,
                      Figures& out) {
    std::vector<const char*> names{"large"};
    for (const char* name : mutations) names.push_back(name);
    const auto add = [&](const std::string& name, const StepCounts& n) {
        if (n.proposed == 0) return;
        const double proposed = double(n.proposed);
        out.push_back({name + "_proposed", proposed});
        out.push_back({name + "_failed", double(n.failed) / proposed});
        out.push_back({name + "_zero", double(n.zero) / proposed});
        out.push_back({name + "_accepted", n.accepted / proposed});
    };
    for (size_t m = 0; m < names.size(); ++m) {
        const auto& by_length = stats.steps[m];
        StepCounts sum;
        for (const StepCounts& n : by_length) sum += n;
        add(names[m], sum);
        for (size_t k = size_t(shortest); k < by_length.size(); ++k)
            add(fmt::format("{}_length_{}", names[m], k), by_length[k]);
    }
}

}  // namespace etendue
