// Bidirectional path tracing [Veach & Guibas 1994; Lafortune & Willems 1993]: all techniques C(s,t), combined by the power
// heuristic. Unbiased. Joins that will add little are thinned by roulette before their shadow ray.

#include "integrator/bdpt.h"

#include "integrator/bidirectional.h"

namespace etendue {
namespace {

class BdptIntegrator final : public Integrator {
public:
    explicit BdptIntegrator(const IntegratorParams& params) : paths_(params) {}

    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts counts = this->counts(c.scene, c.light_paths);
        paths_.light_path(c, counts, work);
        paths_.eye_path(c, counts, work,
                        [&](int t) { paths_.connect_to_own(c, counts, t, work); });
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        return Bidirectional::counts(scene, light_paths);
    }
    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override { return Estimator::Unbiased; }

private:
    Bidirectional paths_;
};

}  // namespace

IntegratorEntry bdpt_entry() {
    return {{"integrator", "bdpt",
             "Bidirectional path tracing with all connections and MIS. Unbiased.",
             Bidirectional::params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<BdptIntegrator>(p);
            }};
}

}  // namespace etendue
