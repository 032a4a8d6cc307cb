#pragma once
// The search for the pairs of an eye vertex, and the Russian roulette that ends most of them [Qin et al. 2015].

#include "math/systematic.h"
#include "pathspace/sample_context.h"
#include "reuse/gather_roulette.h"
#include "reuse/light_vertex_grid.h"
#include "reuse/pair_density.h"
#include "reuse/reciprocal.h"

namespace etendue {

/// A pair of y_{s-1} and z_{t-1}, one of which is dropped.
struct GatherPair {
    Technique technique;
    Neighbourhood kept;  ///< Of the vertex that is kept.
    uint64_t number;     ///< Address of its random numbers.
    float estimate;      ///< Estimated contribution of its join to the pixel, for GatherRoulette.
    float survival;      ///< Probability of surviving all roulette so far.
    /// Ratio of its estimated worth to the threshold of roulette; a pair above 1 always survives.
    float unlimited_survival;

    /// The event from which the dropped vertex was sampled, on the walks y and z.
    PairEvent event(const SubPath& y, const SubPath& z) const {
        if (technique.drops_eye) return {z[technique.t - 2], TransportMode::Radiance, kept};
        return {y[technique.s - 2], TransportMode::Importance, kept};
    }
};

/// The search of one eye path, work.z, among the light vertices of a pass.
struct GatherSearch {
    const SampleContext& c;
    const TechniqueCounts& n;
    const LightVertexCache& cache;
    /// For eye vertices fixed by the film point (Vertex), and for others. Their radii are those of `n`.
    const LightVertexGrid &seen_grid, &inner_grid;
    const PairDensity& density;  ///< For the radius of `inner_grid`.
    const GatherRoulette& roulette;
    int max_depth;    ///< Edges of the longest path.
    float flatness;   ///< Half the height of a neighbourhood over its radius.
    float threshold;  ///< Of join_survival(), for contributions to the own pixel.
    Workspace& work;

    /// Calls use(pair) for the pairs of z_{t-1}, with y_0 … y_{s-1} in work.pair as far as the join reads them.
    template <class Use>
    void for_each_pair(int t, const Use& use) const {
        const float reflected = reflected_flux(t);
        const Vertex& z = work.z[t - 1];
        const LightVertexGrid& grid = grid_of(z);
        // Roulette for the whole search: most pairs of some vertices contribute little. The number of pairs found has
        // the second moment n (n+1), where n is its mean, and a search costs n+1 times as much as one that finds none.
        const float partners = std::max(1.0f, density.partners(z.pair_level) *
                                                  sqr(grid.radius() / inner_grid.radius()));
        const float search_survival = join_survival(
            roulette.of_search(t) * reflected * grid.mean_flux() * std::sqrt(partners), threshold);
        if (!survives(search_survival, pair_number(0, t, kSearch))) return;
        const uint8_t after = gloss_after(t);
        const Neighbourhood near_eye = near(z, arrival_side(z), grid.radius());

        struct Choice {
            float estimate, survival, unlimited_survival;
            bool drops_eye, drops_light;
        };
        GatherSums& sums = GatherSums::of(work);
        uint64_t& candidates = z.is_fixed_by_film ? sums.candidates : sums.inner_candidates;
        std::optional<SystematicSampling> selection;
        const auto is_selected = [&](float q) {
            if (!(q < 1)) return true;
            if (!selection) {
                c.sampler.seek(Stream::Roulette, pair_number(0, t, kLook));
                selection.emplace(c.sampler.next_1d_unstructured());
            }
            return selection->selects(double(q));
        };
        const auto choose = [&](const GatherCandidate& y) -> std::optional<Choice> {
            ++candidates;
            const int edges = y.s + t - 2;
            if (edges > max_depth || !(n.gathers(edges) > 0)) return {};
            Choice choice;
            choice.drops_eye =
                drops(n.pairs.rule, true, y.gloss_before, after) && y.side.admits(near_eye.side);
            choice.drops_light =
                drops(n.pairs.rule, false, y.gloss_before, after) && near_eye.contains(y.p, y.side);
            if (!choice.drops_eye && !choice.drops_light) return {};
            ++work.stats.pairs;
            sums.expected_pairs[z.is_fixed_by_film] +=
                uint64_t(std::lround(256 / std::max(search_survival, 1e-6f)));
            choice.estimate = reflected * y.flux;
            const float worth = roulette.of(y.s, t) * choice.estimate;
            choice.unlimited_survival = threshold > 0 ? worth / threshold : kInf;
            choice.survival = std::min(join_survival(worth, threshold), search_survival);
            if (!is_selected(choice.survival / search_survival)) return {};
            return choice;
        };
        // The neighbourhood of z_{t-1}, or else the ball that holds all those that contain it.
        FlatBall region{z.p, grid.radius()};
        if (keeps_eye(t)) region.n = z.ng, region.half_height = near_eye.half_height;
        grid.for_each_in(region, choose, [&](const GatherCandidate& y, const Choice& choice) {
            for (const bool eye : {true, false}) {
                if (!(eye ? choice.drops_eye : choice.drops_light)) continue;
                cache.restore_first(c.scene, y.vertex, eye ? y.s : y.s - 1, work.is_observed,
                                    work.pair);
                const Neighbourhood kept =
                    eye ? near(work.pair[y.s - 1], y.side, grid.radius()) : near_eye;
                if (eye && !kept.contains(near_eye.p, near_eye.side)) continue;
                use(GatherPair{.technique = {Strategy::Gather, y.s, t, eye},
                               .kept = kept,
                               .number = pair_number(y.vertex, t, eye ? kDropsEye : kDropsLight),
                               .estimate = choice.estimate,
                               .survival = choice.survival,
                               .unlimited_survival = choice.unlimited_survival});
            }
        });
    }

    /// Factor from the contribution of a gather to the pixel's value, without r and roulette.
    float scale() const { return std::fabs(work.z.film_weight) * c.splat_scale; }

    /// Records the contribution of a pair's join for the roulette; an empty join has none.
    void observe(const GatherPair& pair, const std::optional<Join>& join) const {
        if (!(pair.estimate > 0)) return;
        const float value = join ? luminance(join->contribution) * join->mis_weight * scale() /
                                       join->pair_probability
                                 : 0;
        GatherRoulette::observe(pair.technique.s, pair.technique.t, value / pair.estimate,
                                GatherSums::of(work));
    }

private:
    /// Gloss of the vertex from which z_{t-1} was sampled.
    uint8_t gloss_after(int t) const { return gloss(work.z[t - 2], work.z[t - 2].is_delta); }
    /// Whether the pairs of z_{t-1} can only drop the light vertex: next to the lens and to delta events, see drops().
    bool keeps_eye(int t) const { return gloss_after(t) >= kDeltaGloss; }
    const LightVertexGrid& grid_of(const Vertex& z) const {
        return z.is_fixed_by_film ? seen_grid : inner_grid;
    }
    enum Use : uint64_t { kDropsEye, kDropsLight, kLook, kSearch };
    /// Distinct for distinct arguments with t < 2^22, and from join_number().
    static uint64_t pair_number(uint32_t vertex, int t, Use use) {
        return uint64_t(1) << 60 | uint64_t(vertex) << 24 | uint64_t(uint32_t(t)) << 2 | use;
    }
    bool survives(float q, uint64_t number) const {
        if (!(q < 1)) return true;
        c.sampler.seek(Stream::Roulette, number);
        return c.sampler.next_1d_unstructured() < double(q);
    }
    Neighbourhood near(const Vertex& kept, ArrivalSide side, float radius) const {
        return {kept.p, kept.ng, side, radius, flatness * radius};
    }

    /// Estimated contribution to the pixel of a pair at z_{t-1} per unit of flux, before the light path is looked up:
    /// that of a merge on a diffuse surface, times the brightness of the highlight on a glossy one.
    float reflected_flux(int t) const {
        const Vertex& z = work.z[t - 1];
        const float roughness = 1 - float(z.gloss) / kSharpestGloss;
        const float highlight = std::max(1.0f, 0.25f / sqr(roughness));
        const float disc = n.pairs.disc_of(z.is_fixed_by_film);
        const float clamped = keeps_eye(t) ? 1 : std::max(1.0f, disc * z.pdf_fwd);
        return highlight * clamped * luminance(z.beta) * std::fabs(work.z.film_weight) *
               c.splat_scale / (kPi * disc);
    }
};

}  // namespace etendue
