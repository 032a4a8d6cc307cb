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
        const EyeEnd eye = eye_end(t);
        const float search_survival = survival_of_search(eye);
        if (!survives(search_survival, pair_number(0, t, kSearch))) return;
        PairSelection selection(c.sampler, pair_number(0, t, kSelection));
        eye.grid.for_each_in(
            eye.region,
            [&](const GatherCandidate& y) -> std::optional<Choice> {
                const std::optional<Choice> choice = choose(eye, y, search_survival);
                if (!choice || !selection.selects(choice->survival / search_survival)) return {};
                return choice;
            },
            [&](const GatherCandidate& y, const Choice& choice) {
                use_pairs(eye, y, choice, use);
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
    /// z_{t-1}, and what all of its pairs have in common.
    struct EyeEnd {
        int t;
        const Vertex& z;
        uint8_t gloss_after;  ///< Of the vertex from which it was sampled.
        Neighbourhood near;
        const LightVertexGrid& grid;
        FlatBall region;  ///< Contains all light vertices that make a pair with it.
        /// Estimated contribution to the pixel of a pair per unit of flux.
        float reflected;
    };
    /// A light vertex that makes one or two pairs, which are kept if neither roulette ends them.
    struct Choice {
        float estimate, survival, unlimited_survival;  ///< As in GatherPair.
        bool drops_eye, drops_light;
    };
    /// Selects pairs with given probabilities, by one number, which is drawn when it is needed.
    class PairSelection {
    public:
        PairSelection(Sampler& sampler, uint64_t number) : sampler_(sampler), number_(number) {}
        bool selects(float q) {
            if (!(q < 1)) return true;
            if (!sampling_) {
                sampler_.seek(Stream::Roulette, number_);
                sampling_.emplace(sampler_.next_1d_unstructured());
            }
            return sampling_->selects(double(q));
        }

    private:
        Sampler& sampler_;
        uint64_t number_;
        std::optional<SystematicSampling> sampling_;
    };

    EyeEnd eye_end(int t) const {
        const Vertex& z = work.z[t - 1];
        const LightVertexGrid& grid = z.is_fixed_by_film ? seen_grid : inner_grid;
        EyeEnd eye{.t = t,
                   .z = z,
                   .gloss_after = gloss(work.z[t - 2], work.z[t - 2].is_delta),
                   .near = near(z, arrival_side(z), grid.radius()),
                   .grid = grid,
                   .region = {z.p, grid.radius()},
                   .reflected = 0};
        // Next to the lens and to delta events only the light vertex can be dropped, see drops(): the neighbourhood of z_{t-1}.
        // Otherwise, the ball that holds all neighbourhoods which contain z_{t-1}.
        const bool keeps_eye = eye.gloss_after >= kDeltaGloss;
        if (keeps_eye) eye.region.n = z.ng, eye.region.half_height = eye.near.half_height;
        eye.reflected = reflected_flux(z, keeps_eye);
        return eye;
    }

    /// Probability of surviving the roulette for the whole search: most pairs of some vertices contribute little. The number of
    /// pairs found has the second moment n (n+1), where n is its mean, and a search costs n+1 times as much as one that finds
    /// none.
    float survival_of_search(const EyeEnd& eye) const {
        const float partners = std::max(1.0f, density.partners(eye.z.pair_level) *
                                                  sqr(eye.grid.radius() / inner_grid.radius()));
        return join_survival(roulette.of_search(eye.t) * eye.reflected * eye.grid.mean_flux() *
                                 std::sqrt(partners),
                             threshold);
    }

    /// Which of the two vertices the pairs drop, and how probably they survive; empty if there is no pair.
    std::optional<Choice> choose(const EyeEnd& eye, const GatherCandidate& y,
                                 float search_survival) const {
        GatherSums& sums = GatherSums::of(work);
        ++(eye.z.is_fixed_by_film ? sums.candidates : sums.inner_candidates);
        const int edges = y.s + eye.t - 2;
        if (edges > max_depth || !(n.gathers(edges) > 0)) return {};
        Choice choice;
        choice.drops_eye = drops(n.pairs.rule, true, y.gloss_before, eye.gloss_after) &&
                           y.side.admits(eye.near.side);
        choice.drops_light = drops(n.pairs.rule, false, y.gloss_before, eye.gloss_after) &&
                             eye.near.contains(y.p, y.side);
        if (!choice.drops_eye && !choice.drops_light) return {};
        ++work.stats.pairs;
        sums.expected_pairs[eye.z.is_fixed_by_film] +=
            uint64_t(std::lround(256 / std::max(search_survival, 1e-6f)));
        choice.estimate = eye.reflected * y.flux;
        const float worth = roulette.of(y.s, eye.t) * choice.estimate;
        choice.unlimited_survival = threshold > 0 ? worth / threshold : kInf;
        choice.survival = std::min(join_survival(worth, threshold), search_survival);
        return choice;
    }

    template <class Use>
    void use_pairs(const EyeEnd& eye, const GatherCandidate& y, const Choice& choice,
                   const Use& use) const {
        for (const bool drops_eye : {true, false}) {
            if (!(drops_eye ? choice.drops_eye : choice.drops_light)) continue;
            cache.restore_first(c.scene, y.vertex, drops_eye ? y.s : y.s - 1, work.is_observed,
                                work.pair);
            const Neighbourhood kept =
                drops_eye ? near(work.pair[y.s - 1], y.side, eye.grid.radius()) : eye.near;
            if (drops_eye && !kept.contains(eye.near.p, eye.near.side)) continue;
            use(GatherPair{.technique = {Strategy::Gather, y.s, eye.t, drops_eye},
                           .kept = kept,
                           .number =
                               pair_number(y.vertex, eye.t, drops_eye ? kDropsEye : kDropsLight),
                           .estimate = choice.estimate,
                           .survival = choice.survival,
                           .unlimited_survival = choice.unlimited_survival});
        }
    }

    enum Use : uint64_t { kDropsEye, kDropsLight, kSelection, kSearch };
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

    /// See EyeEnd::reflected, before the light path is looked up: that of a merge on a diffuse surface, times the brightness of
    /// the highlight on a glossy one.
    float reflected_flux(const Vertex& z, bool keeps_eye) const {
        const float roughness = 1 - float(z.gloss) / kSharpestGloss;
        const float highlight = std::max(1.0f, 0.25f / sqr(roughness));
        const float disc = n.pairs.disc_of(z.is_fixed_by_film);
        const float clamped = keeps_eye ? 1 : std::max(1.0f, disc * z.pdf_fwd);
        return highlight * clamped * luminance(z.beta) * std::fabs(work.z.film_weight) *
               c.splat_scale / (kPi * disc);
    }
};

}  // namespace etendue
