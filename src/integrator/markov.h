#pragma once
// What the integrators with Markov chains share: options, the pilot, direct light apart, statistics.

#include <cstddef>
#include <optional>

#include "integrator/bidirectional.h"
#include "mcmc/chain_groups.h"
#include "mcmc/pilot.h"

namespace etendue {

using Figures = std::vector<std::pair<std::string, double>>;
/// Adds what the steps did, by mutation and by length from `shortest` on.
void add_step_figures(const ChainStats& stats, std::span<const char* const> mutations, int shortest,
                      Figures& out);

class MarkovIntegrator : public Integrator {
public:
    /// Edges of the shortest path that chains make. Shorter ones are taken by independent samples, one a pixel and pass.
    static constexpr int kShortest = 3;

    /// Of chains; `rr_depth` where walks have roulette.
    static std::vector<ParamInfo> params();

    void trace(const PassContext& pass) final;
    /// Chains can be made only once the scene is known: until then what was loaded is kept as it is.
    void save(LearnedState& to) const final;
    void load(LearnedState& from) final;
    void collect(std::span<const std::unique_ptr<PassSums>>) final {
        if (!groups_) return;
        groups_->commit();
        has_begun_ = true;
    }
    void sample(const SampleContext& context, Workspace& work) const final;

    /// Of the chains; all that they make can be made in all these ways.
    TechniqueCounts counts(const Scene& scene, uint64_t) const override {
        return Bidirectional::counts(scene, whole_film_paths(scene));
    }
    bool uses(const Technique& q, const Scene& scene, uint64_t light_paths) const final {
        const bool is_direct = q.vertices() - 1 < kShortest;
        return (is_direct ? direct_counts(scene, light_paths) : counts(scene, 0)).of(q) > 0;
    }
    uint64_t light_paths(const Scene& scene) const final { return scene.film().pixel_count(); }
    Estimator estimator() const final { return Estimator::Unbiased; }
    int error_groups() const final { return options_.groups; }
    double splat_error_factor() const final { return groups_ ? groups_->own_scale() : 1.0; }
    std::vector<std::pair<std::string, double>> figures() const override;

protected:
    MarkovIntegrator(const IntegratorParams& params, const DepthOptions& depth);

    /// States, and how chains are shared among their classes.
    struct Chains {
        std::unique_ptr<StateSpace> space;
        std::vector<ClassPlan> plan;
    };
    virtual Chains begin(const PassContext& pass, const Pilot& pilot) = 0;
    /// Makes the steps of a pass.
    virtual void advance(const PassContext& pass, const StateSpace&, ChainGroups& groups) {
        groups.advance(pass);
    }

    /// A sample of all techniques, as of `bdpt`, by the walks of `paths`.
    PrimarySample bidirectional_sample(const Scene& scene, const Bidirectional& paths) const;
    /// N_L of the weights: the film's eye paths are spread over so many pixels.
    static uint64_t whole_film_paths(const Scene& scene);

    /// Whether eye paths can hit any.
    static bool hits_emitters(const Scene& scene);

    ChainOptions options_;
    Bidirectional paths_;

private:
    /// Of the shorter paths. Eye paths make all of them, unless some emitter has no extent.
    static TechniqueCounts direct_counts(const Scene& scene, uint64_t light_paths);

    Bidirectional direct_;
    Bidirectional pilot_paths_;  ///< With roulette, even where the chains' walks have none.
    std::unique_ptr<StateSpace> space_;
    std::unique_ptr<ChainGroups> groups_;  ///< Once the first pass has begun.
    bool has_begun_ = false;               ///< A pass stayed. Until then each begins anew.
    std::optional<Pilot> pilot_;
    uint64_t pool_ = 0;
    std::vector<std::byte> loaded_;  ///< Of the groups, until they are made.
};

}  // namespace etendue
