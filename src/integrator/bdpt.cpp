// Bidirectional path tracing [Veach & Guibas 1994; Lafortune & Willems 1993]: all techniques C(s,t), combined by the power
// heuristic. Unbiased. Joins that will add little are thinned by roulette before their shadow ray.

#include "integrator/bdpt.h"

#include <stdexcept>

namespace etendue {
namespace {

class BdptIntegrator final : public Integrator {
public:
    BdptIntegrator(const DepthOptions& depth, float roulette)
        : depth_(depth), roulette_(roulette) {}

    void sample(const SampleContext& c, Workspace& work) const override {
        const float N = float(c.light_paths);
        const TechniqueCounts counts{.hit = 1,
                                     .next_event = 1,
                                     .connect = 1,
                                     .splat = N,
                                     .hit_lens = c.scene.sensor().has_finite_lens() ? N : 0.0f};
        SubPath &y = work.y, &z = work.z;
        trace_light_path(c, counts, work);
        start_eye_path(c.scene, c.film, c.pixel, c.sampler, z, work.stats);
        const WalkOptions walk = depth_.walk();
        for (int t = 2; t <= z.size(); ++t) {
            for_each_hit(c.scene, z, t, counts, [&](const Join& j) {
                c.sink.add_eye(j.technique, j.contribution, j.mis_weight);
            });
            if (t > depth_.max_depth) break;
            if (z[t - 1].may_connect) {
                add_if_visible(c, join_next_event(c.scene, z, t, c.sampler, counts), work);
                const int longest = std::min(y.size(), depth_.max_depth + 1 - t);
                for (int s = 2; s <= longest; ++s)
                    add_if_visible(c, join_connect(c.scene, y, s, z, t, counts), work);
            }
            extend<TransportMode::Radiance>(c.scene, c.sampler, walk, counts, z, work.stats);
        }
    }

    bool traces_light_paths() const override { return true; }
    Estimator estimator() const override { return Estimator::Unbiased; }

private:
    /// The light sub-path, with its techniques t ≤ 1.
    void trace_light_path(const SampleContext& c, const TechniqueCounts& counts,
                          Workspace& work) const {
        SubPath& y = work.y;
        // The last vertex of the longest path is the lens: joined to by a splat, met by a ray if it is finite.
        const WalkOptions walk{depth_.max_depth + c.scene.sensor().has_finite_lens(),
                               depth_.rr_depth};
        if (!start_light_path(c.scene, c.sampler, y, work.stats)) return;
        for (int s = 1; s <= y.size() && s <= depth_.max_depth; ++s) {
            add_if_visible(c, join_splat(c.scene, y, s, c.sampler, counts), work);
            if (s >= 2)
                extend<TransportMode::Importance>(c.scene, c.sampler, walk, counts, y, work.stats);
            add_if_visible(c, join_hit_lens(c.scene, y, s, counts), work);
        }
    }

    void add_if_visible(const SampleContext& c, const std::optional<Join>& j,
                        Workspace& work) const {
        if (!j) return;
        const bool is_splat = j->technique.t <= 1;
        Rgb contribution = j->contribution;
        if (roulette_ > 0) {
            const float expected =
                is_splat ? c.film.expected_luminance(j->film) : c.film.expected_luminance(c.pixel);
            const float share =
                j->mis_weight * (is_splat ? c.splat_scale : std::fabs(work.z.film_weight));
            const float q = join_survival(luminance(contribution) * share, roulette_ * expected);
            if (q < 1) {
                c.sampler.seek(Stream::Roulette,
                               uint32_t(j->technique.s) << 16 | uint32_t(j->technique.t));
                if (!(c.sampler.next_1d_unstructured() < q)) {
                    ++work.stats.joins_skipped;
                    return;
                }
                contribution *= 1 / q;
            }
        }
        const float Tr = visibility(c.scene, *j, work.stats);
        if (!(Tr > 0)) return;
        if (is_splat)
            c.sink.add_splat(j->film, j->technique, contribution * Tr, j->mis_weight);
        else
            c.sink.add_eye(j->technique, contribution * Tr, j->mis_weight);
    }

    DepthOptions depth_;
    float roulette_;  ///< Threshold of join_survival(), relative to the pixel's expected luminance.
};

}  // namespace

IntegratorEntry bdpt_entry() {
    std::vector<ParamInfo> params = depth_params();
    params.push_back({"roulette", ParamKind::Float, "0.05",
                      "Joins that would add less than this share of the pixel's luminance (as "
                      "earlier passes have it) are tested "
                      "with a probability proportional to what they add; 0: all are tested."});
    return {{"integrator", "bdpt",
             "Bidirectional path tracing with all connections and MIS. Unbiased.", params},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                const float roulette = p.number("roulette");
                if (!(roulette >= 0 && roulette <= 1))
                    throw std::runtime_error("bdpt: roulette must lie in [0, 1]");
                return std::make_unique<BdptIntegrator>(DepthOptions::from(p), roulette);
            }};
}

}  // namespace etendue
