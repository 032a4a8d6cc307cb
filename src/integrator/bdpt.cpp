// Bidirectional path tracing [Veach & Guibas 1994; Lafortune & Willems 1993]: all techniques C(s,t), combined by the power
// heuristic, and specular connections X(s,t). Unbiased. The eye path of a pixel is connected to one light path. Joins with a
// small contribution pass Russian roulette before their shadow ray (Bidirectional::add()).

#include "integrator/bdpt.h"

namespace etendue {
namespace {

/// Traces the light path y of this sample, and adds C(s,1) and C(s,0). Where samples share a light path, the first of them
/// adds these.
void trace_light_path(const Bidirectional& paths, const SampleContext& c, const TechniqueCounts& n,
                      Workspace& work, const LearnedPlaces* learned) {
    const PhaseTimer timer(work.stats, &PhaseSeconds::light_paths);
    const WalkContext walk = paths.light_walk(c.scene, n, work.stats, learned);
    const bool adds = c.index < c.light_paths;
    Sampler sampler = c.sampler;
    if (!adds) sampler.start(c.own_light_path());
    SubPath& y = work.y;
    if (!start_light_path(walk, sampler, y)) return;
    for (int s = 1; s <= y.size() && s <= paths.max_depth(); ++s) {
        if (adds) paths.add(c, join_splat(c.scene, y, s, sampler, n), work);  // C(s,1)
        if (s >= 2) extend<TransportMode::Importance>(walk, sampler, y);
        if (adds) paths.add_hit_lens(c, n, s, work);  // C(s+1,0)
    }
}

/// Where there are more light paths than samples: traces the others of this sample, for C(s,1) and C(s,0) alone.
void trace_further_light_paths(const Bidirectional& paths, const SampleContext& c,
                               const TechniqueCounts& n, Workspace& work,
                               const LearnedPlaces* learned) {
    if (c.is_of_whole_film) return;
    const uint64_t samples = c.film.sample_count();
    for (uint64_t path = c.index + samples; path < c.light_paths; path += samples) {
        work.go_on();
        Sampler sampler = c.sampler;
        sampler.start(path);
        trace_light_path(paths, c.with(sampler, c.sink), n, work, learned);
    }
}

}  // namespace

void add_bdpt_joins(const Bidirectional& paths, const SampleContext& c, const TechniqueCounts& n,
                    Workspace& work, const LearnedPlaces* learned) {
    const SubPath &y = work.y, &z = work.z;
    const bool has_light_path = n.uses_light_paths();
    if (has_light_path) {
        trace_further_light_paths(paths, c, n, work, learned);
        trace_light_path(paths, c, n, work, learned);
    }
    const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
    const auto roulette = paths.roulette(c, work);
    for (int t = 2; t <= z.size(); ++t) {
        paths.add_hits(c, n, t, work);  // C(0,t)
        if (!paths.is_joinable(z, t)) continue;
        paths.add_specular(c, n, t, work);                                 // X(s,t)
        paths.add(c, join_next_event(c.scene, z, t, c.sampler, n), work);  // C(1,t)
        if (!has_light_path) continue;
        const PhaseTimer of_connections(work.stats, &PhaseSeconds::connections);
        for (int s = 2; s <= y.size() && s + t - 1 <= paths.max_depth(); ++s)
            paths.add_connection(c, n, y, s, t, roulette, work);  // C(s,t)
    }
}

void add_bdpt_sample(const Bidirectional& paths, const SampleContext& c, const TechniqueCounts& n,
                     Workspace& work, const LearnedPlaces* learned) {
    trace_eye_path(paths.eye_walk(c.scene, n, work.stats, learned), c, work.z);
    add_bdpt_joins(paths, c, n, work, learned);
}

void trace_light_paths(const Bidirectional& paths, const PassContext& pass,
                       const TechniqueCounts& n, uint64_t kept, LightVertexCache& cache,
                       const LearnedPlaces* learned) {
    pass.for_each_light_path([&](const SampleContext& c, Workspace& work) {
        trace_light_path(paths, c, n, work, learned);
        if (c.index < kept) cache.add(c.chunk, work.y);
    });
}

namespace {

class BdptIntegrator final : public Integrator {
public:
    explicit BdptIntegrator(const IntegratorParams& p)
        : paths_(p, Guiding(p), Specular(p)),
          given_light_paths_(uint64_t(p.integer("light_paths", 0, 1 << 30))) {}

    void learn(const LearnContext& pass) override { paths_.learn(pass); }
    void save(LearnedState& to) const override { paths_.save(to); }
    void load(LearnedState& from) override { paths_.load(from); }
    void prepare(const PassContext& pass) override {
        paths_.train(pass, counts(pass.scene, pass.light_paths));
        paths_.prepare_specular(pass, counts(pass.scene, pass.light_paths));
    }

    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        paths_.trace_eye_paths(c, counts(c[0].scene, c[0].light_paths), z, stats);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        add_bdpt_joins(paths_, c, counts(c.scene, c.light_paths), work);
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n = Bidirectional::counts(scene, light_paths);
        n.guide = paths_.guiding().guide();
        n.specular_depth = paths_.specular().depth(scene);
        return n;
    }
    uint64_t light_paths(const Scene& scene) const override {
        return given_light_paths_ > 0 ? given_light_paths_ : scene.film().pixel_count();
    }
    bool samples_alone(const Scene& scene) const override {
        return !paths_.guiding().is_prepared_for(scene) &&
               !paths_.specular().is_prepared_for(scene);
    }
    Estimator estimator() const override { return Estimator::Unbiased; }
    std::vector<std::pair<std::string, double>> figures() const override {
        std::vector<std::pair<std::string, double>> figures = paths_.guiding().figures();
        paths_.specular().add_figures(figures);
        return figures;
    }

private:
    Bidirectional paths_;
    uint64_t given_light_paths_;  ///< 0: one for each pixel.
};

}  // namespace

IntegratorEntry bdpt_entry() {
    return {{"integrator", "bdpt",
             "Bidirectional path tracing with all connections and MIS. Unbiased.",
             concat({Bidirectional::params(),
                     {{"light_paths", ParamKind::Int, "0",
                       "Number of light paths in a pass; pixel i connects to light path i modulo "
                       "light_paths. 0: one for each pixel."}},
                     Specular::params(),
                     Guiding::lights_params(),
                     Guiding::params()})},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<BdptIntegrator>(p);
            }};
}

}  // namespace etendue
