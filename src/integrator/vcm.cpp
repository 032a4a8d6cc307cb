// Vertex connection and merging, or unified path sampling [Georgiev et al. 2012; Hachisuka et al. 2012]: bidirectional
// path tracing whose eye vertices also merge with light vertices of all paths of the pass. With `exact` they gather
// them instead, with the disc's approximation of the probability that the pair was found [Bekaert et al. 2003; Qin et
// al. 2015, fig. 11 b].
//
// Techniques: C(s,t) and M(s,t), or U(s,t). Consistent where the radius shrinks [Knaus & Zwicker 2011].

#include "integrator/vcm.h"

#include <stdexcept>

#include <fmt/format.h>

#include "integrator/bdpt.h"
#include "integrator/light_path_options.h"
#include "integrator/radius_params.h"
#include "reuse/gather.h"
#include "reuse/gather_constants.h"
#include "reuse/merge_kernel.h"

namespace etendue {
namespace {

/// Ratio of the radius of merges behind a diffuse or glossy eye vertex to that of other merges. The former share a
/// random eye path, so each of them adds less information. They matter for light that no other technique finds.
constexpr float kInnerRadius = 0.3f;

class VcmIntegrator final : public Integrator {
public:
    explicit VcmIntegrator(const IntegratorParams& p)
        : paths_(p, Guiding(p)), radius_params_(p), connects_(p.flag("connections")),
          merges_(p.flag("merges")), is_exact_(p.flag("exact")), light_(p),
          continuation_(p.number("continuation")) {
        if (!connects_ && !merges_)
            throw std::runtime_error("vcm: connections and merges cannot both be false");
        if (!(continuation_ > 0 && continuation_ <= 1))
            throw std::runtime_error(
                fmt::format("vcm: continuation must lie in (0, 1], but is {}", continuation_));
        if (is_exact_ && !merges_) throw std::runtime_error("vcm: exact=true requires merges=true");
    }

    void learn(const LearnContext& pass) override {
        paths_.learn(pass);
        roulette_.learn(gathers_);
        if (merges_ && pass.film.passes() > 0)
            density_ = PairDensity(cells(),
                                   radius_params_.radius(pass.scene, pass.index) *
                                       (is_exact_ ? 1 : kInnerRadius),
                                   kGatherConstants.merge_correlation);
    }
    void save(LearnedState& to) const override {
        paths_.save(to);
        to.put(gathers_);
        to.put(roulette_);
        density_.save(to);
        cells().save(to);
    }
    void load(LearnedState& from) override {
        paths_.load(from);
        from.get(gathers_);
        from.get(roulette_);
        density_.load(from);
        loaded_.load(from);
        grid_ = {};
    }
    bool is_learning() const override { return merges_; }
    std::unique_ptr<PassSums> make_sums() const override { return std::make_unique<GatherSums>(); }
    void collect(std::span<const std::unique_ptr<PassSums>> workers) override {
        gathers_.add(workers);
    }

    void prepare(const PassContext& pass) override {
        paths_.train(pass, counts(pass.scene, pass.light_paths));
    }
    void trace(const PassContext& pass) override {
        radius_ = radius_params_.radius(pass.scene, pass.index);
        cache_.begin(pass.chunks(pass.light_paths), kVertexBytes, light_.memory,
                     paths_.guiding().guide());
        trace_light_paths(paths_, pass, counts(pass.scene, pass.light_paths), pass.light_paths,
                          cache_, &density_);
        cache_.assemble();
        if (merges_) grid_.build(cache_, reach() * radius_, first_merge());
        loaded_ = {};
    }

    void trace_eye_paths(std::span<const SampleContext> c, std::span<SubPath> z,
                         RenderStats& stats) const override {
        paths_.trace_eye_paths(c, counts(c[0].scene, c[0].light_paths), z, stats, &density_);
    }
    void sample(const SampleContext& c, Workspace& work) const override {
        const TechniqueCounts n = counts(c.scene, c.light_paths);
        const SubPath &y = work.y, &z = work.z;
        if (connects_) cache_.restore(c.scene, c.own_light_path(), work.y);
        const PhaseTimer timer(work.stats, &PhaseSeconds::eye_paths);
        const auto roulette = paths_.roulette(c, work);
        for (int t = 2; t <= z.size(); ++t) {
            paths_.add_hits(c, n, t, work);  // C(0,t)
            if (!paths_.is_joinable(z, t)) continue;
            if (connects_) {
                paths_.add(c, join_next_event(c.scene, z, t, c.sampler, n), work);  // C(1,t)
                const PhaseTimer of_connections(work.stats, &PhaseSeconds::connections);
                for (int s = 2; s <= y.size() && s + t - 1 <= paths_.max_depth(); ++s)
                    paths_.add_connection(c, n, y, s, t, roulette, work);  // C(s,t)
            }
            if (is_exact_)
                gather(c, n, t, work);  // U(s,t)
            else if (merges_)
                merge(c, n, t, work);  // M(s,t)
        }
    }

    TechniqueCounts counts(const Scene& scene, uint64_t light_paths) const override {
        TechniqueCounts n;
        n.hit = 1;
        if (connects_) n = Bidirectional::counts(scene, light_paths);
        if (merges_) {
            (is_exact_ ? n.gather : n.merge) = float(light_paths);
            n.pairs.disc = kPi * sqr(radius_);
            n.pairs.inner_disc = is_exact_ ? n.pairs.disc : n.pairs.disc * sqr(kInnerRadius);
            n.pairs.clamps = false;
            n.pairs.first_merge = first_merge();
        }
        if (merges_ && !is_exact_) n.continued = continuation_;
        n.guide = paths_.guiding().guide();
        return n;
    }
    uint64_t light_paths(const Scene& scene) const override {
        return light_.count(scene, paths_.depth(), paths_.vertex_bytes(kVertexBytes));
    }
    uint64_t light_path_memory() const override { return light_.memory; }
    std::vector<std::pair<std::string, double>> figures() const override {
        return paths_.guiding().figures();
    }
    Estimator estimator() const override {
        return !merges_                   ? Estimator::Unbiased
               : radius_params_.shrinks() ? Estimator::Consistent
                                          : Estimator::Biased;
    }

private:
    /// Connections include next events, which make direct light with less noise than merges do.
    int first_merge() const { return connects_ && !is_exact_ ? 2 : 1; }
    /// Distance of the farthest vertices that are used, divided by the radius.
    float reach() const { return is_exact_ ? 1 : MergeKernel::kReach; }
    /// Number of light vertices by cell, in the previous pass.
    CellCounts cells() const {
        return grid_.points().is_empty() ? loaded_ : grid_.points().counts();
    }

    /// Adds M(s,t) for the light vertices near z_{t-1}.
    void merge(const SampleContext& c, const TechniqueCounts& n, int t, Workspace& work) const {
        const Vertex& z = work.z[t - 1];
        const ArrivalSide side = arrival_side(z);
        const auto choose = [&](const GatherCandidate& y) -> std::optional<Chosen> {
            if (y.s + t - 2 > paths_.max_depth() || !side.admits(y.side)) return {};
            return Chosen{};
        };
        const float radius = z.is_fixed_by_film ? radius_ : kInnerRadius * radius_;
        grid_.for_each_in({z.p, reach() * radius}, choose, [&](const GatherCandidate& y, Chosen) {
            cache_.restore_first(c.scene, y.vertex, y.s, work.is_observed, work.pair, false);
            const auto join = join_merge(work.pair, y.s, work.z, t, n);
            if (!join) return;
            ++work.stats.pairs;
            const float weight = MergeKernel::weight(length2(y.p - z.p), radius);
            c.sink.add(*join, join->contribution * (weight * c.splat_scale));
        });
    }

    /// Adds U(s,t), with the approximation q π d² p̃ of p_c. q is the survival probability of the Russian roulette
    /// before the dropped vertex [Qin et al. 2015, eq. 7].
    void gather(const SampleContext& c, const TechniqueCounts& n, int t, Workspace& work) const {
        const GatherSearch search{.c = c,
                                  .n = n,
                                  .cache = cache_,
                                  .seen_grid = grid_,
                                  .inner_grid = grid_,
                                  .density = density_,
                                  .roulette = roulette_,
                                  .max_depth = paths_.max_depth(),
                                  .flatness = 1,  // a ball
                                  .threshold = paths_.threshold(c),
                                  .work = work};
        search.for_each_pair(t, [&](const GatherPair& pair) {
            const auto& [strategy, s, t_, drops_eye] = pair.technique;
            const auto join = join_gather(c.scene, work.pair, s, work.z, t_, drops_eye, n);
            search.observe(pair, join);
            if (!join) return;
            const PairEvent event = pair.event(work.pair, work.z);
            // Its reciprocal could overflow, where the quotient below does not.
            const float probability = event.from.survival.value() * join->pair_probability;
            const auto value = paths_.test(c, *join, search.scale() / (probability * pair.survival),
                                           pair.number, work);
            if (!value) return;
            ++work.stats.visible_pairs;
            c.sink.add(*join, *value / Rgb(probability) * (c.splat_scale / pair.survival));
        });
    }

    static constexpr uint64_t kVertexBytes =
        LightVertexCache::kVertexBytes + LightVertexGrid::kVertexBytes;

    Bidirectional paths_;
    RadiusParams radius_params_;
    bool connects_, merges_, is_exact_;
    LightPathOptions light_;
    float continuation_;  ///< See TechniqueCounts::continued.

    // Learned.
    GatherTotals gathers_;
    PairDensity density_;
    GatherRoulette roulette_;
    CellCounts loaded_;  ///< The result of cells() until a pass has been made.

    // Of the pass.
    float radius_ = 0;
    LightVertexCache cache_;
    LightVertexGrid grid_;
};

std::vector<ParamInfo> vcm_params() {
    return concat(
        {Bidirectional::params(),
         radius_params("Merging radius of the first pass, in scene units. 0: automatic, a disc of "
                       "about 36 pixels at the median depth, but at most 1 % of the radius of what "
                       "the camera sees. Behind the first diffuse or glossy vertex of an eye path, "
                       "0.3 times this radius is used."),
         LightPathOptions::params(),
         {{"continuation", ParamKind::Float, "0.25",
           "Probability, in (0, 1], with which an eye path continues after its first vertex that "
           "is not a mirror or clear glass. Merges at this vertex make most of the image, so the "
           "rest of the path is worth less than its cost. The MIS weights know this probability. "
           "Has no effect with exact=true or merges=false."}},
         Guiding::lights_params(),
         Guiding::params(),
         {{"connections", ParamKind::Bool, "true",
           "Whether sub-paths are connected to each other, to emitters and to the lens.", true},
          {"merges", ParamKind::Bool, "true", "Whether vertices are merged.", true},
          {"exact", ParamKind::Bool, "false",
           "Whether merges form true paths, with a shadow ray and the BSDFs at both ends; the "
           "probability of a pair is still that of a disc [Bekaert et al. 2003].",
           true}}});
}

}  // namespace

IntegratorEntry vcm_entry() {
    return {{"integrator", "vcm",
             "Vertex connection and merging. Consistent; biased with a fixed radius.",
             vcm_params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<VcmIntegrator>(p);
            }};
}

}  // namespace etendue
