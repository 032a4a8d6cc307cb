#pragma once
// Base class of the integrators with Markov chains: options, the pilot run, direct light without chains, statistics.

#include <cstddef>
#include <optional>

#include "integrator/bidirectional.h"
#include "mcmc/chain_groups.h"
#include "mcmc/pilot.h"
#include "mcmc/weighed_sample.h"

namespace etendue {

using Figures = std::vector<std::pair<std::string, double>>;
/// Adds the statistics of steps to `out`, by mutation, and by path length from `shortest` on.
void add_step_figures(const ChainStats& stats, std::span<const char* const> mutations, int shortest,
                      Figures& out);

class MarkovIntegrator : public Integrator {
public:
    /// Of the walks of pilots and of those that train a guide, where chains have `depth`. Without Russian roulette, walks would
    /// not end in a closed room.
    static DepthOptions pilot_depth(const DepthOptions& depth) {
        constexpr int kPilotRoulette = 10;
        return {depth.max_depth, std::min(depth.rr_depth, kPilotRoulette)};
    }
    /// Length in edges of the shortest paths that chains make. Shorter paths are made by one independent sample per pixel
    /// and pass.
    static constexpr int kShortest = 3;

    /// The parameters of chains.
    static std::vector<ParamInfo> params();

    void trace(const PassContext& pass) final;
    /// Chains can be made only when the scene is known; until then the loaded data are kept unchanged.
    void save(LearnedState& to) const final;
    void load(LearnedState& from) final;
    void collect(std::span<const std::unique_ptr<PassSums>>) final {
        if (!groups_) return;
        groups_->commit();
        has_begun_ = true;
    }
    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const final;
    void sample(const SampleContext& context, Workspace& work) const final;

    /// The counts of the chains' techniques.
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
    /// What a mutation is worth: about the mean over the scenes of docs/benchmarks.md.
    struct StepWorth {
        double correlation;  ///< Variance of a mean over mutations, relative to independent states.
        double cost;         ///< Time of a mutation, divided by that of a sample of direct light.
    };
    /// `guiding` must be given if the integrator has the parameter Guiding::params().
    MarkovIntegrator(const IntegratorParams& params, const DepthOptions& depth, StepWorth worth,
                     Guiding guiding = {});

    /// The space of states, and the parameters of its classes and pools (ChainOptions).
    struct Chains {
        std::unique_ptr<StateSpace> space;
        std::vector<ClassPlan> plan;
        uint64_t pool;
        double later = 0;
        double large_step = 1;
    };
    virtual Chains begin(const PassContext& pass, const Pilot& pilot) = 0;
    /// Whether the walks of large steps are guided, as those of the pilot; otherwise it has their light by technique apart.
    virtual bool guides_large_steps() const { return true; }
    /// Makes the steps of a pass.
    virtual void advance(const PassContext& pass, const StateSpace&, ChainGroups& groups) {
        groups.advance(pass);
    }

    /// From now on, paths_ tests joins that have a small part of the target of a state with a probability in proportion.
    void use_roulette(const FilmGeometry& film, const Pilot& pilot);

    /// The counts of samples of bidirectional path tracing, whose walks are guided.
    TechniqueCounts guided_counts(const Scene& scene) const;
    /// A sample of all techniques of `bdpt`, with the walks of `paths`.
    static PrimarySample bidirectional_sample(const Bidirectional& paths, const TechniqueCounts& n);
    /// Samples of all techniques as states of the single paths of which they consist. Walks and joins have Russian roulette,
    /// as in pssmlt, since most joins of long walks have a small part of the target.
    WeighedSample samples_of_paths(const Scene& scene, const Pilot& pilot);
    /// Chains whose states are single paths, which are found by these samples.
    static Chains chains_of_paths(std::unique_ptr<StateSpace> space, std::vector<ClassPlan> plan,
                                  uint64_t pool) {
        return {std::move(space), std::move(plan), pool, kLaterSamples, kLargeStep};
    }
    /// N_L in the weights: the number of pixels over which the eye paths of the film are distributed.
    static uint64_t whole_film_paths(const Scene& scene);

    ChainOptions options_;
    Bidirectional paths_;

private:
    /// Of states that are single paths: samples for each mutation, and what a large step, which tries one technique for one
    /// length, counts beside a sample of all.
    static constexpr double kLaterSamples = 1.0 / 32, kLargeStep = 0.25;

    /// The counts for the shorter paths. Eye paths make all of them, unless an emitter has no extent.
    static TechniqueCounts direct_counts(const Scene& scene, uint64_t light_paths);
    /// The same with the learned selection of emitters.
    TechniqueCounts guided_direct_counts(const Scene& scene, uint64_t light_paths) const;
    /// After the guide was trained or loaded.
    void set_direct_guide();

    /// Mutations per pixel and pass, as given or from the pilot.
    double mutations_per_pixel() const;

    StepWorth worth_;
    Guiding guiding_;  ///< Trained once: all chains and samples have the same guide.
    Bidirectional direct_;
    std::optional<Guide>
        direct_guide_;  ///< What direct light takes of the guide: the selection of emitters.
    Bidirectional pilot_paths_;  ///< With Russian roulette, even if the walks of chains have none.
    Bidirectional finding_paths_;  ///< Of samples_of_paths().
    std::unique_ptr<StateSpace> space_;
    std::unique_ptr<ChainGroups> groups_;  ///< Set when the first pass starts.
    bool has_begun_ = false;  ///< Whether a pass was kept; until then each starts anew.
    std::optional<Pilot> pilot_;
    uint64_t pool_ = 0;              ///< Samples in the first pool of a group.
    std::vector<std::byte> loaded_;  ///< Loaded data of the groups, until they are made.
};

}  // namespace etendue
