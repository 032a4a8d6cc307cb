// Path tracing with next event estimation [Kajiya 1986; Veach 1997, §9.3].
//
// Techniques: C(0,t) hits, C(1,t) next events, and specular connections X(s,t), combined by the power heuristic. Unbiased.
// Limits: light of small emitters that reaches diffuse surfaces by way of mirrors or glass is found only by chance, unless
// X(s,t) finds it: if they are smooth. The same light of point and directional emitters is never found by chance.

#include "integrator/path.h"

#include "integrator/guiding.h"
#include "integrator/specular.h"
#include "pathspace/eye_paths.h"

namespace etendue {
namespace {

class PathIntegrator final : public Integrator {
public:
    explicit PathIntegrator(const IntegratorParams& p)
        : depth_(DepthOptions::from(p)), guiding_(p), specular_(p),
          roulette_(p.number("roulette", 0, 1)) {}

    void save(LearnedState& to) const override {
        guiding_.save(to);
        specular_.save(to);
    }
    void load(LearnedState& from) override {
        guiding_.load(from);
        specular_.load(from);
    }
    void prepare(const PassContext& pass) override {
        guiding_.train(pass, counts(pass.scene, 0), depth_, GuidedWalks::Eye);
        specular_.prepare(pass, depth_, counts(pass.scene, 0));
    }

    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        const Scene& scene = c[0].scene;
        etendue::trace_eye_paths({scene, counts(scene, 0), stats, depth_.walk()}, c, z);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts counts = this->counts(c.scene, 0);
        const SubPath& z = work.z;
        for (int t = 2; t <= z.size(); ++t) {
            for_each_hit(c.scene, z, t, counts,
                         [&](const Join& j) { Specular::add_hit(c, j, z, t, counts); });
            if (t > depth_.max_depth) break;
            if (const auto j = join_next_event(c.scene, z, t, c.sampler, counts))
                if (const float Tr = visibility(c.scene, *j, work.stats); Tr > 0)
                    c.sink.add(*j, j->contribution * Tr);
            if (counts.specular_depth > 0)
                specular_.add(c, t, depth_.max_depth, roulette_ * c.expected_of_pixel(), roulette_,
                              counts, work);
        }
    }

    TechniqueCounts counts(const Scene& scene, uint64_t /*light_paths*/) const override {
        return {.hit = 1,
                .next_event = 1,
                .guide = guiding_.guide(),
                .specular_depth = specular_.depth(scene)};
    }
    uint64_t light_paths(const Scene&) const override { return 0; }
    std::vector<std::pair<std::string, double>> figures() const override {
        std::vector<std::pair<std::string, double>> figures = guiding_.figures();
        specular_.add_figures(figures);
        return figures;
    }
    bool samples_alone(const Scene& scene) const override {
        return !guiding_.is_prepared_for(scene) && !specular_.is_prepared_for(scene);
    }
    Estimator estimator() const override { return Estimator::Unbiased; }

private:
    DepthOptions depth_;
    Guiding guiding_;
    Specular specular_;
    float
        roulette_;  ///< Threshold of specular connections, relative to the pixel's expected luminance.
};

}  // namespace

IntegratorEntry path_entry() {
    return {
        {"integrator", "path",
         "Path tracing with next event estimation and MIS, the simplest method. Unbiased.",
         concat(
             {depth_params(),
              Specular::params(),
              {{"roulette", ParamKind::Float, "0.15",
                "Specular connections of small contributions are searched for at random, and the "
                "others weighted up. Threshold, in [0, 1], as a fraction of the pixel's luminance "
                "in earlier passes; 0 searches for all."}},
              Guiding::lights_params(),
              Guiding::params()})},
        [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
            return std::make_unique<PathIntegrator>(p);
        }};
}

}  // namespace etendue
