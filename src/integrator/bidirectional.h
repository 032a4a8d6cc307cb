#pragma once
// What the bidirectional integrators share: both sub-paths with their joins, and the roulette before shadow rays.

#include <cmath>
#include <optional>

#include "integrator/light_path_collector.h"

namespace etendue {

/// How an eye path goes on from a vertex.
enum class Onward { ByAnyEvent, ByDeltaEvents, Ends };

class Bidirectional {
public:
    static std::vector<ParamInfo> params();
    explicit Bidirectional(const IntegratorParams& params);

    /// Counts of bidirectional path tracing, without pairs.
    static TechniqueCounts counts(const Scene& scene, uint64_t light_paths) {
        const float N = float(light_paths);
        return {.hit = 1,
                .next_event = 1,
                .connect = 1,
                .splat = N,
                .hit_lens = scene.sensor().has_finite_lens() ? N : 0.0f};
    }

    /// Sets the thresholds of efficiency-optimised roulette from what earlier passes brought.
    void begin_pass(const PassContext& pass);

    /// The light sub-path `y`; `before(s)` and `after(s)` are called for every y_{s-1} before and after the walk leaves it.
    template <class Before, class After>
    void walk_light_path(const Scene& scene, Sampler& sampler, const TechniqueCounts& counts,
                         SubPath& y, RenderStats& stats, const Before& before,
                         const After& after) const {
        // The last vertex of the longest path is the lens: joined to by a splat, met by a ray if it is finite.
        const WalkOptions walk{depth_.max_depth + scene.sensor().has_finite_lens(),
                               depth_.rr_depth};
        if (!start_light_path(scene, sampler, counts, y, stats)) return;
        for (int s = 1; s <= y.size() && s <= depth_.max_depth; ++s) {
            before(s);
            if (s >= 2) extend<TransportMode::Importance>(scene, sampler, walk, counts, y, stats);
            after(s);
        }
    }
    /// The light sub-path work.y, with its techniques t ≤ 1.
    void light_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const;

    /// Goes on with the eye sub-path `z` from z_{t-1}, its last vertex so far. `at_vertex(t)` is called for it and every
    /// later one, while it is the last, and returns an Onward.
    template <class AtVertex>
    void walk_eye_path(const Scene& scene, Sampler& sampler, const TechniqueCounts& counts,
                       SubPath& z, RenderStats& stats, int t, const AtVertex& at_vertex) const {
        for (; t <= z.size(); ++t) {
            const Onward onward = at_vertex(t);
            if (t > depth_.max_depth || onward == Onward::Ends) break;
            extend<TransportMode::Radiance>(scene, sampler, depth_.walk(), counts, z, stats);
            if (onward == Onward::ByDeltaEvents && !z[t - 1].is_delta) break;
        }
    }

    /// The eye sub-path work.z with its hits. `join(t)` is called for every z_{t-1} that may be joined, while it is the
    /// last, and returns an Onward.
    template <class JoinVertex>
    void eye_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work,
                  const JoinVertex& join) const {
        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        start_eye_path(c.scene, c.film, c.pixel, c.sampler, counts, work.z, work.stats);
        go_on(c, counts, work, 2, join);
    }
    /// The same from z_{t-1} on, the last vertex so far.
    template <class JoinVertex>
    void go_on(const SampleContext& c, const TechniqueCounts& counts, Workspace& work, int t,
               const JoinVertex& join) const {
        const SubPath& z = work.z;
        walk_eye_path(c.scene, c.sampler, counts, work.z, work.stats, t, [&](int last) {
            if (counts.hit > 0)
                for_each_hit(c.scene, z, last, counts,
                             [&](const Join& j) { c.sink.add(j, j.contribution); });
            return z[last - 1].may_connect && last <= depth_.max_depth ? join(last)
                                                                       : Onward::ByAnyEvent;
        });
    }
    /// One more vertex of the eye sub-path work.z, unless it ends.
    void step(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const {
        extend<TransportMode::Radiance>(c.scene, c.sampler, depth_.walk(), counts, work.z,
                                        work.stats);
    }

    /// C(1,t) by next event.
    void add_next_event(const SampleContext& c, const TechniqueCounts& counts, int t,
                        Workspace& work) const;
    /// Connects z_{t-1} to all vertices of work.y but y_0.
    void connect_to_own(const SampleContext& c, const TechniqueCounts& counts, int t,
                        Workspace& work) const;

    /// Traces the light paths of the pass with their techniques t ≤ 1; the first `kept` go into `collector`, which has
    /// begun.
    void trace_light_paths(const PassContext& pass, const TechniqueCounts& counts, uint64_t kept,
                           LightPathCollector& collector) const;

    /// Adds C(s,t), where there is one, times `factor`, if it is visible: one of several joins that z_{t-1} draws.
    void add_drawn(const SampleContext& c, const std::optional<Join>& j, float factor, int draw,
                   Workspace& work) const;

    /// What is left of a join's contribution after the roulette and the shadow ray; nothing where they end it. A unit of
    /// contribution adds `scale` to its pixel; `number` tells joins of one sample apart.
    std::optional<Rgb> test(const SampleContext& c, const Join& join, float scale, uint32_t number,
                            Workspace& work) const;
    /// Adds a connection, where there is one and it passes test().
    void add_if_visible(const SampleContext& c, const std::optional<Join>& j,
                        Workspace& work) const;

    int max_depth() const { return depth_.max_depth; }
    /// Of join_survival(), for what is added to the own pixel.
    float threshold(const SampleContext& c) const { return threshold(c, nullptr); }

private:
    /// Of join_survival(); `splat`: where it is added, nullptr: to the own pixel.
    float threshold(const SampleContext& c, const Vec2* splat) const;
    /// Adds the join, where there is one, times `factor`, unless test() ends it.
    void add(const SampleContext& c, const std::optional<Join>& j, float factor, uint32_t number,
             Workspace& work) const;

    DepthOptions depth_;
    float roulette_;  ///< Threshold of join_survival(), relative to the pixel's expected luminance.
    bool is_optimised_;              ///< The thresholds below instead.
    std::vector<float> thresholds_;  ///< By pixel, of this pass; empty until there are some.
};

}  // namespace etendue
