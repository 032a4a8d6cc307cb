#pragma once
// Common parts of the bidirectional integrators: their options, both walks, and what adds a join: Russian roulette, the
// shadow ray and the sink. bdpt.cpp has the loops over s and t.

#include "integrator/guiding.h"
#include "integrator/specular.h"
#include "pathspace/eye_paths.h"
#include "reuse/light_vertex_cache.h"

namespace etendue {

class Bidirectional {
public:
    static std::vector<ParamInfo> params();
    /// `guiding` must be given if the integrator has the parameter Guiding::params(), and so must `specular`.
    explicit Bidirectional(const IntegratorParams& params, Guiding guiding = {},
                           const Specular& specular = {});
    /// Without Russian roulette of joins. Paths with fewer than `shortest` edges are left out.
    Bidirectional(const DepthOptions& depth, int shortest)
        : depth_(depth), shortest_(shortest), roulette_(0), is_optimised_(false) {}

    /// Sets the thresholds of join_survival() by pixel, also for samples of the whole film, for which they must be fixed.
    void set_roulette(std::vector<float> thresholds) { thresholds_ = std::move(thresholds); }

    /// Sample counts of bidirectional path tracing, without merges and gathers.
    static TechniqueCounts counts(const Scene& scene, uint64_t light_paths) {
        const float N = float(light_paths);
        return {.hit = 1,
                .next_event = 1,
                .connect = 1,
                .splat = N,
                .hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f};
    }

    /// Trains the guide. For Integrator::prepare().
    void train(const PassContext& pass, const TechniqueCounts& counts,
               GuidedWalks walks = GuidedWalks::Both) {
        guiding_.train(pass, counts, depth_, walks);
    }

    /// See Specular::prepare(). For Integrator::prepare(), after train().
    void prepare_specular(const PassContext& pass, const TechniqueCounts& counts) {
        specular_.prepare(pass, depth_, counts);
    }

    /// Sets the thresholds of efficiency-optimised roulette from the statistics of earlier passes, in which all samples
    /// together traced `rays` rays.
    void learn(const LearnContext& pass, uint64_t rays);
    void learn(const LearnContext& pass) { learn(pass, pass.so_far.rays()); }
    void save(LearnedState& to) const {
        to.put(thresholds_);
        guiding_.save(to);
        specular_.save(to);
    }
    void load(LearnedState& from) {
        from.get(thresholds_);
        guiding_.load(from);
        specular_.load(from);
    }
    const Guiding& guiding() const { return guiding_; }
    const Specular& specular() const { return specular_; }
    /// Memory of a stored light vertex that needs `bytes` where nothing is guided.
    uint64_t vertex_bytes(uint64_t bytes) const {
        return bytes + (guiding_.is_on() ? LightVertexCache::kGuideBytes : 0);
    }

    WalkContext eye_walk(const Scene& scene, const TechniqueCounts& counts, RenderStats& stats,
                         const LearnedPlaces* learned = nullptr) const {
        return {scene, counts, stats, depth_.walk(), learned};
    }
    /// The last vertex of the longest path is the lens. A splat connects to it; a ray may hit it if it is finite.
    WalkContext light_walk(const Scene& scene, const TechniqueCounts& counts, RenderStats& stats,
                           const LearnedPlaces* learned = nullptr) const {
        return {scene,
                counts,
                stats,
                {depth_.max_depth + scene.sensor().has_finite_lens(), depth_.rr_depth,
                 depth_.has_roulette},
                learned};
    }

    /// For Integrator::trace_eye_paths().
    void trace_eye_paths(std::span<const SampleContext> c, const TechniqueCounts& counts,
                         std::span<SubPath> z, RenderStats& stats,
                         const LearnedPlaces* learned = nullptr) const;
    /// Whether z_{t-1} can be joined to a light sub-path without exceeding the maximum path length.
    bool is_joinable(const SubPath& z, int t) const {
        return z[t - 1].is_connectible && t <= depth_.max_depth;
    }

    /// Adds C(0,t).
    void add_hits(const SampleContext& c, const TechniqueCounts& counts, int t,
                  const Workspace& work, float factor = 1) const {
        if (counts.hit > 0 && t - 1 >= shortest_)
            for_each_hit(c.scene, work.z, t, counts, [&](const Join& j) {
                Specular::add_hit(c, j, work.z, t, counts, factor);
            });
    }
    /// Adds C(s+1,0).
    void add_hit_lens(const SampleContext& c, const TechniqueCounts& counts, int s,
                      Workspace& work) const {
        auto join = join_hit_lens(c.scene, work.y, s, counts);
        if (join) Specular::weigh_hit_lens(*join, c.scene, work.y, s, counts);
        add(c, join, work);
    }
    /// Adds X(s,t).
    void add_specular(const SampleContext& c, const TechniqueCounts& counts, int t,
                      Workspace& work) const {
        if (counts.specular_depth > 0)
            specular_.add(c, t, depth_.max_depth, threshold(c), is_optimised_ ? 0 : roulette_,
                          counts, work);
    }

    /// Thresholds of join_survival() for contributions to the film point of the eye path work.z, which its joins with t ≥ 2
    /// share.
    struct Roulette {
        float threshold;
        float scale;  ///< What a unit of contribution adds to its pixel.
    };
    Roulette roulette(const SampleContext& c, const Workspace& work) const {
        return {threshold(c, c.is_of_whole_film ? &work.z.film : nullptr),
                std::fabs(work.z.film_weight)};
    }
    /// Makes C(s,t) of light vertices of `y`, t ≥ 2, and adds it as add() does. Unlike there, the weight is not computed where
    /// roulette ends the join with any weight.
    void add_connection(const SampleContext& c, const TechniqueCounts& counts, const SubPath& y,
                        int s, int t, const Roulette& roulette, Workspace& work, float factor = 1,
                        uint32_t draw = 0) const;

    /// Adds the join, times `factor`, if it exists and passes test(), whose result is returned. If z_{t-1} has several
    /// joins of the same technique, `draw` distinguishes them.
    std::optional<Rgb> add(const SampleContext& c, const std::optional<Join>& join, Workspace& work,
                           float factor = 1, uint32_t draw = 0) const {
        return join ? add_join(c, *join, work, factor, draw) : std::nullopt;
    }
    /// The contribution of a join after Russian roulette and the shadow ray; empty if either of them ends it. A unit of
    /// contribution adds `scale` to its pixel. `number` distinguishes the joins of one sample.
    std::optional<Rgb> test(const SampleContext& c, const Join& join, float scale, uint64_t number,
                            Workspace& work) const;
    /// The same for a join that survives roulette with probability min(1, q).
    static std::optional<Rgb> test_with_survival(const SampleContext& c, const Join& join, float q,
                                                 uint64_t number, Workspace& work);

    const DepthOptions& depth() const { return depth_; }
    int max_depth() const { return depth_.max_depth; }
    /// Threshold of join_survival() for contributions to the own pixel.
    float threshold(const SampleContext& c) const { return threshold(c, nullptr); }

private:
    std::optional<Rgb> add_join(const SampleContext& c, const Join& join, Workspace& work,
                                float factor, uint32_t draw) const;
    /// Threshold of join_survival() for contributions at a film point, or to the own pixel if `film` is nullptr.
    float threshold(const SampleContext& c, const Vec2* film) const;

    DepthOptions depth_;
    Guiding guiding_;
    Specular specular_;
    int shortest_ = 1;  ///< Length of the shortest paths, in edges.
    float roulette_;  ///< Threshold of join_survival(), relative to the pixel's expected luminance.
    bool is_optimised_;              ///< Efficiency-optimised roulette, which sets thresholds_.
    std::vector<float> thresholds_;  ///< By pixel, instead of roulette_; empty until they are set.
};

}  // namespace etendue
