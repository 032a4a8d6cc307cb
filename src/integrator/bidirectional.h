#pragma once
// What the bidirectional integrators share: both sub-paths with their joins, and the roulette before shadow rays.

#include <cmath>
#include <optional>

#include "integrator/integrator.h"

namespace etendue {

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

    /// The light sub-path work.y, with its techniques t ≤ 1.
    void light_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const;

    /// The eye sub-path `z`; `at_vertex(t)` is called for every z_{t-1}, t ≥ 2, while it is the last.
    template <class AtVertex>
    void walk_eye_path(const Scene& scene, const Film& film, uint64_t pixel, Sampler& sampler,
                       const TechniqueCounts& counts, SubPath& z, RenderStats& stats,
                       const AtVertex& at_vertex) const {
        start_eye_path(scene, film, pixel, sampler, z, stats);
        const WalkOptions walk = depth_.walk();
        for (int t = 2; t <= z.size(); ++t) {
            at_vertex(t);
            if (t > depth_.max_depth) break;
            extend<TransportMode::Radiance>(scene, sampler, walk, counts, z, stats);
        }
    }

    /// The eye sub-path work.z with its hits and next events. `join(t)` is called for every z_{t-1} that may be joined
    /// to light vertices, while it is the last.
    template <class JoinVertex>
    void eye_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work,
                  const JoinVertex& join) const {
        const SubPath& z = work.z;
        walk_eye_path(c.scene, c.film, c.pixel, c.sampler, counts, work.z, work.stats, [&](int t) {
            if (counts.hit > 0)
                for_each_hit(c.scene, z, t, counts,
                             [&](const Join& j) { c.sink.add(j, j.contribution); });
            if (!z[t - 1].may_connect) return;
            join(t);
            if (counts.next_event > 0 && t <= depth_.max_depth)
                add_if_visible(c, join_next_event(c.scene, z, t, c.sampler, counts), work);
        });
    }

    /// Connects z_{t-1} to all vertices of work.y but y_0.
    void connect_to_own(const SampleContext& c, const TechniqueCounts& counts, int t,
                        Workspace& work) const;

    /// What is left of a join's contribution after the roulette and the shadow ray; nothing where they end it. A unit of
    /// contribution adds `scale` to its pixel; `number` tells joins of one sample apart.
    std::optional<Rgb> test(const SampleContext& c, const Join& join, float scale, uint32_t number,
                            Workspace& work) const;

    int max_depth() const { return depth_.max_depth; }

private:
    void add_if_visible(const SampleContext& c, const std::optional<Join>& j,
                        Workspace& work) const;

    DepthOptions depth_;
    float roulette_;  ///< Threshold of join_survival(), relative to the pixel's expected luminance.
};

}  // namespace etendue
