#pragma once
// The gather of a pair: one of its vertices dropped, the other joined to the dropped one's predecessor.

#include "integrator/photons.h"
#include "pathspace/reciprocal.h"

namespace etendue {

/// U(s,t) of the eye sub-path work.z and the light vertices near its last vertex.
struct Gather {
    const SampleContext& c;
    const Bidirectional& paths;
    const Photons& photons;
    const TechniqueCounts& n;
    float flatness;  ///< Half the height of a neighbourhood over its radius.
    Workspace& work;

    /// The pairs of z_{t-1}. `reciprocal(event, join, seen)` is r, an estimate of 1/p_c; it is asked last, with the sampler
    /// at numbers that belong to this technique of the pair alone. `seen`: the inverse of the probability that roulette
    /// spared the join, times its transmittance.
    template <class Reciprocal>
    void operator()(int t, const Reciprocal& reciprocal) const {
        const Vertex& last = work.z[t - 2];
        const uint8_t after = gloss(last, last.is_delta);
        const auto drops_here = [&](bool eye, const Partner& partner) {
            return drops(n.pair_rule, eye, partner.gloss_before, after);
        };
        const Neighbourhood near_eye = near(work.z[t - 1]);
        const auto may_pair = [&](const Partner& y) {
            const int edges = y.s + t - 2;
            return edges <= paths.max_depth() && n.gathers(edges) > 0 &&
                   (drops_here(true, y) || (drops_here(false, y) && near_eye.contains(y.p)));
        };
        photons.for_each_near(work.z[t - 1].p, may_pair, [&](const Partner& y) {
            const float rate = n.gathers(y.s + t - 2) / n.gather;
            const uint32_t number = uint32_t(hash_combine(y.vertex, uint64_t(t)));
            if (rate < 1) {
                c.sampler.seek(Stream::Roulette, number + 2);  // join() has the first two
                if (!(c.sampler.next_1d_unstructured() < rate)) return;
            }
            for (const bool eye : {true, false})
                if (drops_here(eye, y) && (eye || near_eye.contains(y.p)))
                    join({Strategy::Gather, y.s, t, eye}, y.vertex, number + eye, rate, reciprocal);
        });
    }

private:
    Neighbourhood near(const Vertex& kept) const {
        return {kept.p, kept.ng, photons.radius(), flatness * photons.radius()};
    }

    template <class Reciprocal>
    void join(const Technique& q, uint32_t vertex, uint32_t number, float rate,
              const Reciprocal& reciprocal) const {
        const SubPath& z = work.z;
        SubPath& y = work.pair;
        const LightPaths& light = photons.paths();
        const bool eye = q.drops_eye;
        light.restore_first(c.scene, vertex, eye ? q.s : q.s - 1, work.is_observed, y);
        if (eye && !near(y[q.s - 1]).contains(z[q.t - 1].p)) return;
        ++work.stats.pairs;
        const auto j = join_gather(c.scene, y, q.s, z, q.t, eye, n);
        if (!j) return;
        const float scale = std::fabs(z.film_weight) * c.splat_scale / rate;
        const auto value = paths.test(c, *j, scale / j->found, number, work);
        if (!value) return;
        ++work.stats.visible_pairs;
        c.sampler.seek(Stream::Auxiliary, number);
        const PairEvent event{.from = eye ? z[q.t - 2] : y[q.s - 2],
                              .mode = eye ? TransportMode::Radiance : TransportMode::Importance,
                              .u_emission = y.u_emission,
                              .near = near(eye ? y[q.s - 1] : z[q.t - 1])};
        const double r = reciprocal(event, *j, luminance(*value) / luminance(j->contribution));
        c.sink.add(*j, *value * (float(r) * c.splat_scale / rate));
    }
};

}  // namespace etendue
