#pragma once
// What the bidirectional integrators share: both sub-paths with their joins, and the roulette before shadow rays.

#include <cmath>
#include <optional>

#include "integrator/integrator.h"

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

    /// The light sub-path work.y, with its techniques t ≤ 1.
    void light_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const;

    /// The eye sub-path work.z with its techniques t ≥ 2, connected to work.y. `at_vertex(t)` is called for every
    /// z_{t-1} that may be joined, while it is the last, and returns an Onward.
    template <class AtVertex>
    void eye_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work,
                  const AtVertex& at_vertex) const {
        start_eye_path(c.scene, c.film, c.pixel, c.sampler, work.z, work.stats);
        go_on(c, counts, work, 2, at_vertex);
    }
    /// The same from z_{t-1} on, the last vertex so far.
    template <class AtVertex>
    void go_on(const SampleContext& c, const TechniqueCounts& counts, Workspace& work, int t,
               const AtVertex& at_vertex) const {
        SubPath &y = work.y, &z = work.z;
        for (; t <= z.size(); ++t) {
            if (counts.hit > 0)
                for_each_hit(c.scene, z, t, counts,
                             [&](const Join& j) { c.sink.add(j, j.contribution); });
            if (t > depth_.max_depth) break;
            const Onward onward = z[t - 1].may_connect ? at_vertex(t) : Onward::ByAnyEvent;
            if (onward == Onward::Ends) break;
            if (z[t - 1].may_connect && counts.connect > 0) {
                add_if_visible(c, join_next_event(c.scene, z, t, c.sampler, counts), work);
                const int longest = std::min(y.size(), depth_.max_depth + 1 - t);
                for (int s = 2; s <= longest; ++s)
                    add_if_visible(c, join_connect(c.scene, y, s, z, t, counts), work);
            }
            step(c, counts, work);
            if (onward == Onward::ByDeltaEvents && !z[t - 1].is_delta) break;
        }
    }

    /// One more vertex of the eye sub-path work.z, unless it ends.
    void step(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const {
        extend<TransportMode::Radiance>(c.scene, c.sampler, depth_.walk(), counts, work.z,
                                        work.stats);
    }

    /// What is left of a join's contribution after the roulette and the shadow ray; nothing where they end it. A unit of
    /// contribution adds `scale` to its pixel; `number` tells joins of one sample apart.
    std::optional<Rgb> test(const SampleContext& c, const Join& join, float scale, uint32_t number,
                            Workspace& work) const;
    /// Adds a connection, where there is one and it passes test().
    void add_if_visible(const SampleContext& c, const std::optional<Join>& j,
                        Workspace& work) const;

    int max_depth() const { return depth_.max_depth; }

private:
    DepthOptions depth_;
    float roulette_;  ///< Threshold of join_survival(), relative to the pixel's expected luminance.
};

}  // namespace etendue
