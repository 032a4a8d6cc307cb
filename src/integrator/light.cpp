// Light tracing, or particle tracing: light paths are connected to the lens [Dutré & Willems 1995].
//
// Techniques: C(s,1) splats and, with a finite lens, C(s,0). Unbiased for the paths it can make. Limits: with a
// pinhole, everything that is seen in a mirror or through glass is missing.

#include "integrator/light.h"

#include "integrator/guiding.h"

namespace etendue {
namespace {

class LightIntegrator final : public Integrator {
public:
    explicit LightIntegrator(const IntegratorParams& p)
        : depth_(DepthOptions::from(p)), guiding_(p) {}

    void save(LearnedState& to) const override { guiding_.save(to); }
    void load(LearnedState& from) override { guiding_.load(from); }
    void prepare(const PassContext& pass) override {
        guiding_.train(pass, counts(pass.scene, pass.light_paths), depth_, GuidedWalks::Light);
    }

    void sample(const SampleContext& c, Workspace& work) const override {
        if (c.index >= c.light_paths) return;  // outside the crop
        const TechniqueCounts counts = this->counts(c.scene, c.light_paths);
        // The last vertex of the longest path is the lens. A splat connects to it; a ray may hit it if it is finite.
        const WalkContext walk{
            c.scene,
            counts,
            work.stats,
            {depth_.max_depth + c.scene.sensor().has_finite_lens(), depth_.rr_depth}};
        SubPath& y = work.y;
        if (!start_light_path(walk, c.sampler, y)) return;
        for (int s = 1; s <= y.size(); ++s) {
            if (s > depth_.max_depth) break;
            if (const auto j = join_splat(c.scene, y, s, c.sampler, counts))
                if (const float Tr = visibility(c.scene, *j, work.stats); Tr > 0)
                    c.sink.add(*j, j->contribution * Tr);
            if (s >= 2) extend<TransportMode::Importance>(walk, c.sampler, y);
            if (const auto j = join_hit_lens(c.scene, y, s, counts))
                c.sink.add(*j, j->contribution);
        }
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        const float N = float(light_paths);
        return {.splat = N,
                .hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f,
                .guide = guiding_.guide()};
    }
    uint64_t light_paths(const Scene& scene) const override { return scene.film().pixel_count(); }
    std::vector<std::pair<std::string, double>> figures() const override {
        return guiding_.figures();
    }
    bool samples_alone(const Scene&) const override { return !guiding_.is_on(); }
    Estimator estimator() const override { return Estimator::Unbiased; }

private:
    DepthOptions depth_;
    Guiding guiding_;
};

}  // namespace

IntegratorEntry light_entry() {
    return {{"integrator", "light",
             "Light tracing: connects light paths to the lens. Unbiased for the paths that it can "
             "make.",
             concat({depth_params(), Guiding::params()})},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<LightIntegrator>(p);
            }};
}

}  // namespace etendue
