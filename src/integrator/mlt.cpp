// Metropolis light transport in path space [Veach 1997, ch. 11]: a state is a full path, and mutations replace a part of it
// or move it slightly. Unbiased.
//
// Large steps, and the states from which chains start, are paths made by one technique each, as in mmlt. Direct light is
// computed without chains.

#include "integrator/mlt.h"

#include <algorithm>
#include <stdexcept>

#include "integrator/markov.h"
#include "mcmc/path_space.h"

namespace etendue {
namespace {

class MltIntegrator final : public MarkovIntegrator {
public:
    explicit MltIntegrator(const IntegratorParams& p)
        : MarkovIntegrator(p, DepthOptions::from(p), {.correlation = 10, .cost = 1.25}, Guiding(p)),
          user_paths_(p.string("user_paths")),
          user_ratio_(double(p.number("user_ratio", 0.01f, 100.0f))) {
        if (!user_paths_.empty() && p.string("guide") != "off")
            throw std::runtime_error(
                "mlt: with user_paths no samples are made that a guide could lead; leave out "
                "user_paths or guide");
    }

protected:
    Chains begin(const PassContext& pass, const Pilot& pilot) override {
        constexpr int kTabulated = 24;  // lengths for which the pilot's techniques are used
        const Scene& scene = pass.scene;
        const TechniqueCounts n = counts(scene, 0);
        const int longest = paths_.max_depth();
        PathTarget target{
            PathMeasure(scene, reached_region(scene.film(), scene.filter()), kShortest, longest),
            weighted_luminance(pilot.map), LengthChoice(kShortest, longest, pilot.by_technique),
            TechniqueChoice(scene, kShortest, std::min(kTabulated, longest - kShortest + 1),
                            pilot.by_unguided_technique.empty() ? pilot.by_technique
                                                                : pilot.by_unguided_technique)};
        const ClassPlan plan{.chains = options_.chains, .c = pilot.constant()};
        PathMutations mutations;
        if (!user_paths_.empty()) {
            target.user = {UserPaths::load(scene, user_paths_), user_ratio_ / (1 + user_ratio_)};
            mutations.weights[PathMutations::UserPath] =
                user_ratio_ * mutations.weights[PathMutations::Bidirectional];
        }
        // Samples of bidirectional path tracing do not follow user paths. Large steps do.
        if (target.user.paths)
            return {std::make_unique<PathSpace>(std::move(target), mutations, n),
                    {plan},
                    pool_samples(4 * pilot.precise_samples, options_)};
        return chains_of_paths(std::make_unique<PathSpace>(std::move(target), mutations, n,
                                                           samples_of_paths(scene, pilot)),
                               {plan}, pool_samples(pilot.precise_samples, options_));
    }

    bool guides_large_steps() const override { return false; }

private:
    std::string user_paths_;  ///< File; empty: none.
    double user_ratio_;
};

}  // namespace

IntegratorEntry mlt_entry() {
    return {{"integrator", "mlt",
             "Metropolis light transport on paths: mutations replace a part of a path, or move it "
             "slightly. Unbiased.",
             concat({{depth_params()[0]},
                     MarkovIntegrator::params(),
                     {{"user_paths", ParamKind::String, "",
                       "JSON file of important light sub-paths, which `etendue paths` makes and "
                       "checks; large steps and the start-up follow them, and proposals near them "
                       "are mixed with bidirectional mutations."},
                      {"user_ratio", ParamKind::Float, "1",
                       "Number of proposals near user paths for each bidirectional mutation, and "
                       "of large steps that follow them for each other one, 0.01 to 100."}},
                     Guiding::lights_params(),
                     Guiding::params(GuideRefits::Never)})},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<MltIntegrator>(p);
            }};
}

}  // namespace etendue
