#pragma once
// Guided walks, and the selection of lamps by next events, as all integrators have them: the options, the training before
// pass 0, and refits between passes.

#include <memory>

#include "guide/guide.h"
#include "integrator/integrator.h"

namespace etendue {

/// Walks that a method guides. With pairs, each eye path meets the light paths of all pixels.
enum class GuidedWalks { Eye, Light, Both, BothWithPairs };

/// Light that guided walks bring. Other samples may make the paths of one and two edges.
enum class GuidedLight : bool { All, Indirect };

enum class GuideRefits : bool { Never, BetweenPasses };

class Guiding {
public:
    static std::vector<ParamInfo> params(GuideRefits refits = GuideRefits::BetweenPasses);
    /// Of methods with next events.
    static std::vector<ParamInfo> lights_params();
    Guiding() = default;
    explicit Guiding(const IntegratorParams& params);

    /// False with `guide=off`: then no walk is ever guided.
    bool is_on() const { return mode_ != Mode::Off; }
    /// Whether train() may learn anything in this scene.
    bool is_prepared_for(const Scene& scene) const { return is_on() || selects_lights(scene); }
    /// Trains before pass 0, and refits where the image has had 8, 64, 512 … times as many samples of pixels as walks, from
    /// walks of its own: light walks show eye walks where radiance comes from, and eye walks show light walks where
    /// importance does. Each round is guided by the one before. For Integrator::prepare(); chains call it once, before
    /// anything that it guides. `counts`: those of the method; `light`: what guided walks contribute, by which Russian roulette
    /// ends them. Where no walk is guided, it learns the selection of lamps alone, and once.
    void train(const PassContext& pass, const TechniqueCounts& counts, const DepthOptions& depth,
               GuidedWalks walks, GuidedLight light = GuidedLight::All);
    /// What guides walks and next events until the next call of train(); nullptr where nothing does.
    const Guide* guide() const { return guide_.get(); }
    /// Whether it guides walks, and not next events alone.
    bool guides_walks() const { return guide_ && is_on(); }
    /// Whether it is worth while to compare renderings with this guide and without.
    static bool may_gain(const Guide& guide, GuidedWalks walks);

    void save(LearnedState& to) const;
    void load(LearnedState& from);
    /// See Integrator::figures().
    std::vector<std::pair<std::string, double>> figures() const;
    void add_figures(std::vector<std::pair<std::string, double>>& figures) const;

private:
    enum class Mode { Off, On, Footprints };
    /// `teacher` guides the walks that train; `for_roulette`: whether they are joined, so that their contributions can be
    /// learned.
    std::unique_ptr<Guide> trained(const PassContext& pass, const DepthOptions& depth,
                                   GuidedWalks guided, GuidedLight light, const Guide* teacher,
                                   uint64_t walks, uint64_t seed, bool for_roulette,
                                   bool selects_lights) const;

    bool selects_lights(const Scene& scene) const {
        return learns_lights_ && scene.has_emitter_choice();
    }
    void train_walks(const PassContext& pass, const DepthOptions& depth, GuidedWalks walks,
                     GuidedLight light, bool selects_lights);
    /// The selection of lamps, if it gains anything.
    LightSelections trained_lights(const PassContext& pass, const DepthOptions& depth) const;

    /// Whether walks are better off without guided directions at surfaces.
    bool gains_nothing(const Guide& guide, GuidedWalks walks) const;

    Mode mode_ = Mode::Off;
    bool learns_lights_ = false;
    uint64_t walks_ = 0;                  ///< Of each kind, in training.
    bool has_roulette_ = false;           ///< The option; see Guide::has_roulette.
    std::shared_ptr<const Guide> given_;  ///< See IntegratorSpec::guide.
    std::unique_ptr<Guide> guide_;
    uint64_t refits_ =
        0;  ///< Logarithm to base 8 of the samples over the walks, at the last call of train().
    double seconds_ = 0;                      ///< Spent in train().
    std::shared_ptr<SharedByPilots> pilots_;  ///< Null in renderings that are no pilots.
};

}  // namespace etendue
