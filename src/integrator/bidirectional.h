#pragma once
// What the bidirectional integrators share: both walks, and the roulette before shadow rays.

#include "integrator/guiding.h"
#include "reuse/light_vertex_cache.h"

namespace etendue {

class Bidirectional {
public:
    static std::vector<ParamInfo> params();
    /// `guiding` has to be given where the integrator has Guiding::param().
    explicit Bidirectional(const IntegratorParams& params, Guiding guiding = {});
    /// Without roulette of joins; paths of less than `shortest` edges are left out.
    Bidirectional(const DepthOptions& depth, int shortest)
        : depth_(depth), shortest_(shortest), roulette_(0), is_optimised_(false) {}

    /// Counts of bidirectional path tracing, without pairs.
    static TechniqueCounts counts(const Scene& scene, uint64_t light_paths) {
        const float N = float(light_paths);
        return {.hit = 1,
                .next_event = 1,
                .connect = 1,
                .splat = N,
                .hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f};
    }

    /// Trains the guide for a pass, before anything of it is traced.
    void train(const PassContext& pass) { guiding_.train(pass, depth_); }

    /// Sets the thresholds of efficiency-optimised roulette from what earlier passes brought.
    void learn(const LearnContext& pass);
    void save(LearnedState& to) const {
        to.put(thresholds_);
        guiding_.save(to);
    }
    void load(LearnedState& from) {
        from.get(thresholds_);
        guiding_.load(from);
    }
    const Guiding& guiding() const { return guiding_; }

    WalkContext eye_walk(const Scene& scene, const TechniqueCounts& counts, RenderStats& stats,
                         const LearnedPlaces* learned = nullptr) const {
        return {scene, counts, stats, depth_.walk(), learned};
    }
    /// The last vertex of the longest path is the lens: joined to by a splat, met by a ray if it is finite.
    WalkContext light_walk(const Scene& scene, const TechniqueCounts& counts, RenderStats& stats,
                           const LearnedPlaces* learned = nullptr) const {
        return {scene,
                counts,
                stats,
                {depth_.max_depth + scene.sensor().has_finite_lens(), depth_.rr_depth},
                learned};
    }

    /// The light sub-path work.y of the light path c.own_light_path(). Its techniques C(s,1) and C(s,0) are added for the
    /// first pixel that it belongs to.
    void trace_light_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work,
                          const LearnedPlaces* learned = nullptr) const;
    /// The eye sub-path work.z.
    void trace_eye_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work,
                        const LearnedPlaces* learned = nullptr) const;
    /// Whether z_{t-1} can be joined to a light sub-path, for some path that is not too long.
    bool is_joinable(const SubPath& z, int t) const {
        return z[t - 1].is_connectible && t <= depth_.max_depth;
    }

    /// Traces the light paths of the pass, with their techniques C(s,1) and C(s,0); the first `kept` go into `cache`, which
    /// has begun.
    void trace_light_paths(const PassContext& pass, const TechniqueCounts& counts, uint64_t kept,
                           LightVertexCache& cache, const LearnedPlaces* learned = nullptr) const;

    /// Everything that the sub-paths of one sample bring: bidirectional path tracing.
    void add_sample(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const;
    /// The eye sub-path, C(0,t) and C(1,t); `join(t)` adds what else z_{t-1} is joined to.
    template <class JoinMore>
    void add_eye_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work,
                      const LearnedPlaces* learned, const JoinMore& join) const {
        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        trace_eye_path(c, counts, work, learned);
        const SubPath& z = work.z;
        for (int t = 2; t <= z.size(); ++t) {
            add_hits(c, counts, t, work);
            if (!is_joinable(z, t)) continue;
            if (counts.next_event > 0)
                add(c, join_next_event(c.scene, z, t, c.sampler, counts), work);
            join(t);
        }
    }
    /// C(s,t), s ≥ 2, with the light sub-path work.y.
    void add_connections(const SampleContext& c, const TechniqueCounts& counts, int t,
                         Workspace& work) const {
        const PhaseTimer timer(work.stats, &PhaseSeconds::connections);
        for (int s = 2; s <= work.y.size() && s + t - 1 <= max_depth(); ++s)
            add(c, join_connect(c.scene, work.y, s, work.z, t, counts), work);
    }
    /// C(s,t) alone, times `factor`, with sub-paths no longer than it needs.
    void add_technique(const SampleContext& c, const TechniqueCounts& counts, int s, int t,
                       float factor, Workspace& work) const;

    /// C(0,t).
    void add_hits(const SampleContext& c, const TechniqueCounts& counts, int t,
                  const Workspace& work, float factor = 1) const {
        if (counts.hit > 0 && t - 1 >= shortest_)
            for_each_hit(c.scene, work.z, t, counts,
                         [&](const Join& j) { c.sink.add(j, j.contribution * factor); });
    }
    /// Adds a join, where there is one and it passes test(). Where z_{t-1} draws several of one technique each is added
    /// times `factor`, and `draw` (from 1 on) tells them apart.
    void add(const SampleContext& c, const std::optional<Join>& join, Workspace& work,
             float factor = 1, uint32_t draw = 0) const;
    /// What is left of a join's contribution after the roulette and the shadow ray; nothing where they end it. A unit of
    /// contribution adds `scale` to its pixel; `number` tells joins of one sample apart.
    std::optional<Rgb> test(const SampleContext& c, const Join& join, float scale, uint64_t number,
                            Workspace& work) const;

    const DepthOptions& depth() const { return depth_; }
    int max_depth() const { return depth_.max_depth; }
    /// Of join_survival(), for what is added to the own pixel.
    float threshold(const SampleContext& c) const { return threshold(c, nullptr); }

private:
    /// Of join_survival(); `splat`: where it is added, nullptr: to the own pixel.
    float threshold(const SampleContext& c, const Vec2* splat) const;

    DepthOptions depth_;
    Guiding guiding_;
    int shortest_ = 1;  ///< Edges.
    float roulette_;  ///< Threshold of join_survival(), relative to the pixel's expected luminance.
    bool is_optimised_;              ///< The thresholds below instead.
    std::vector<float> thresholds_;  ///< By pixel, of this pass; empty until there are some.
};

}  // namespace etendue
