// Primary sample space Metropolis light transport [Kelemen et al. 2002] over samples of bidirectional path tracing: a
// state is the set of random numbers of an eye and a light sub-path, and contributes all joins of the two. Unbiased.
//
// Direct light is computed without chains. Small steps change every number; block steps draw the numbers of some
// vertices anew.

#include "integrator/pssmlt.h"

#include "integrator/markov.h"

namespace etendue {
namespace {

class PssmltIntegrator final : public MarkovIntegrator {
public:
    explicit PssmltIntegrator(const IntegratorParams& p)
        : MarkovIntegrator(p, DepthOptions::from(p), {.correlation = 10, .cost = 4}, Guiding(p)) {}

protected:
    Chains begin(const PassContext& pass, const Pilot& pilot) override {
        use_roulette(pass.scene.film(), pilot);
        const ClassPlan plan{.chains = options_.chains, .c = pilot.constant()};
        return {std::make_unique<PrimarySpace>(
                    1, bidirectional_sample(paths_, guided_counts(pass.scene)), pilot.map),
                {plan},
                pool_samples(pilot.precise_samples, options_)};
    }
};

}  // namespace

IntegratorEntry pssmlt_entry() {
    return {{"integrator", "pssmlt",
             "Metropolis light transport in the primary sample space of bidirectional path "
             "tracing. Unbiased.",
             concat({sub_path_params(), MarkovIntegrator::params(), Guiding::lights_params(),
                     Guiding::params(GuideRefits::Never)})},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<PssmltIntegrator>(p);
            }};
}

}  // namespace etendue
