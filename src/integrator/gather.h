#pragma once
// The gather of a pair: one of its vertices dropped, the other joined to the dropped one's predecessor.

#include "integrator/pair_worth.h"
#include "integrator/photons.h"
#include "pathspace/reciprocal.h"

namespace etendue {

/// U(s,t) of the eye sub-path work.z and the light vertices near its last vertex.
struct Gather {
    const SampleContext& c;
    const Bidirectional& paths;
    const Photons& photons;
    const PairWorth& worth;
    const TechniqueCounts& n;
    float flatness;   ///< Half the height of a neighbourhood over its radius.
    float threshold;  ///< Of roulette, see Bidirectional::threshold().
    Workspace& work;

    /// The pairs of z_{t-1}. `reciprocal(event, join, seen)` is r, an estimate of 1/p_c; it is asked last, with the sampler
    /// at numbers that belong to this technique of the pair alone. `seen`: the inverse of the probability that roulette
    /// spared the join, times its transmittance.
    template <class Reciprocal>
    void operator()(int t, const Reciprocal& reciprocal) const {
        const float brought = reflected(t);
        const Vertex& z = work.z[t - 1];
        // Where most partners are not worth a look, z_{t-1} mostly looks for none. A search that finds n of them has a
        // second moment of n (n+1), and takes n+1 times as long as to find none.
        const float partners = std::max(1.0f, photons.density().partners(z.pair_level));
        const float looks = join_survival(
            worth.of_search(t) * brought * photons.mean_flux() * std::sqrt(partners), threshold);
        if (!survives(looks, uint32_t(hash_combine(UINT32_MAX, uint64_t(t))))) return;
        const Vertex& last = work.z[t - 2];
        const uint8_t after = gloss(last, last.is_delta);
        const auto drops_here = [&](bool eye, const Partner& partner) {
            return drops(n.pair_rule, eye, partner.gloss_before, after);
        };
        const Neighbourhood near_eye = near(z, z.arrival_side());
        const auto may_pair = [&](Partner& y) {
            const int edges = y.s + t - 2;
            if (edges > paths.max_depth() || !(n.gathers(edges) > 0)) return false;
            y.drops_eye = drops_here(true, y) && y.side.admits(near_eye.side);
            y.drops_light = drops_here(false, y) && near_eye.contains(y.p, y.side);
            if (!y.drops_eye && !y.drops_light) return false;
            ++work.stats.pairs;
            y.estimate = brought * y.flux;
            const float wanted =
                rate(edges) * join_survival(worth.of(y.s, t) * y.estimate, threshold);
            y.rate = std::min(wanted, looks);
            return survives(y.rate / looks, number(y, t) + 2);  // join() has the first two
        };
        photons.for_each_near(z.p, may_pair, [&](const Partner& y) {
            for (const bool eye : {true, false})
                if (eye ? y.drops_eye : y.drops_light)
                    join({Strategy::Gather, y.s, t, eye}, y, near_eye, number(y, t) + eye,
                         reciprocal);
        });
    }

private:
    bool survives(float q, uint32_t number) const {
        if (!(q < 1)) return true;
        c.sampler.seek(Stream::Roulette, number);
        return c.sampler.next_1d_unstructured() < q;
    }
    Neighbourhood near(const Vertex& kept, ArrivalSide side) const {
        return {kept.p, kept.ng, side, photons.radius(), flatness * photons.radius()};
    }

    static uint32_t number(const Partner& y, int t) {
        return uint32_t(hash_combine(y.vertex, uint64_t(t)));
    }
    /// The share of pairs that is used of paths of so many edges.
    float rate(int edges) const { return n.gathers(edges) / n.gather; }

    /// What a pair at z_{t-1} adds to its pixel for each unit of flux, as far as roulette knows before it looks up the
    /// light path: as a merge does on a diffuse surface, or on one as bright as the highlight of a glossy one.
    float reflected(int t) const {
        const Vertex& z = work.z[t - 1];
        const float roughness = 1 - float(z.gloss) / kSharpestGloss;
        const float highlight = std::max(1.0f, 0.25f / sqr(roughness));
        const float clamped = std::max(1.0f, n.disc * z.pdf_fwd);
        return highlight * clamped * luminance(z.beta) * std::fabs(work.z.film_weight) *
               c.splat_scale / (kPi * n.disc);
    }

    template <class Reciprocal>
    void join(const Technique& q, const Partner& partner, const Neighbourhood& near_eye,
              uint32_t number, const Reciprocal& reciprocal) const {
        const SubPath& z = work.z;
        SubPath& y = work.pair;
        const LightPaths& light = photons.paths();
        const bool eye = q.drops_eye;
        light.restore_first(c.scene, partner.vertex, eye ? q.s : q.s - 1, work.is_observed, y);
        const Neighbourhood kept = eye ? near(y[q.s - 1], partner.side) : near_eye;
        if (eye && !kept.contains(near_eye.p, near_eye.side)) return;
        const auto j = join_gather(c.scene, y, q.s, z, q.t, eye, n);
        const float scale = std::fabs(z.film_weight) * c.splat_scale;
        if (partner.estimate > 0) {
            const float brings =
                j ? luminance(j->contribution) * j->mis_weight * scale / j->found : 0;
            PairWorth::observe(q.s, q.t, brings / partner.estimate, work.stats);
        }
        if (!j) return;
        const auto value = paths.test(c, *j, scale / (partner.rate * j->found), number, work);
        if (!value) return;
        ++work.stats.visible_pairs;
        c.sampler.seek(Stream::Auxiliary, number);
        const PairEvent event{.from = eye ? z[q.t - 2] : y[q.s - 2],
                              .mode = eye ? TransportMode::Radiance : TransportMode::Importance,
                              .u_emission = y.u_emission,
                              .near = kept};
        const float survival = partner.rate / rate(q.s + q.t - 2);
        const double r =
            reciprocal(event, *j, luminance(*value) / (luminance(j->contribution) * survival));
        c.sink.add(*j, *value * (float(r) * c.splat_scale / partner.rate));
    }
};

}  // namespace etendue
