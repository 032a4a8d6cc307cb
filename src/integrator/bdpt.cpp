// Bidirectional path tracing [Veach & Guibas 1994; Lafortune & Willems 1993]: all techniques C(s,t), combined by the power
// heuristic. Unbiased.

#include "integrator/bdpt.h"

namespace etendue {
namespace {

class BdptIntegrator final : public Integrator {
public:
    explicit BdptIntegrator(const DepthOptions& depth) : depth_(depth) {}

    void sample(const SampleContext& c, Workspace& work) const override {
        const float N = float(c.light_paths);
        const TechniqueCounts counts{.hit = 1, .next_event = 1, .connect = 1, .splat = N,
                                     .hit_lens = c.scene.sensor().has_finite_lens() ? N : 0.0f};
        SubPath &y = work.y, &z = work.z;
        trace_light_path(c, counts, work);
        start_eye_path(c.scene, c.film, c.pixel, c.sampler, z, work.stats);
        const WalkOptions walk = depth_.walk();
        for (int t = 2; t <= z.size(); ++t) {
            for_each_hit(c.scene, z, t, counts,
                         [&](const Join& j) { c.sink.add_eye(j.technique, j.contribution, j.mis_weight); });
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
    void trace_light_path(const SampleContext& c, const TechniqueCounts& counts, Workspace& work) const {
        SubPath& y = work.y;
        // The last vertex of the longest path is the lens: joined to by a splat, met by a ray if it is finite.
        const WalkOptions walk{depth_.max_depth + c.scene.sensor().has_finite_lens(), depth_.rr_depth};
        if (!start_light_path(c.scene, c.sampler, y, work.stats)) return;
        for (int s = 1; s <= y.size() && s <= depth_.max_depth; ++s) {
            add_if_visible(c, join_splat(c.scene, y, s, c.sampler, counts), work);
            if (s >= 2) extend<TransportMode::Importance>(c.scene, c.sampler, walk, counts, y, work.stats);
            add_if_visible(c, join_hit_lens(c.scene, y, s, counts), work);
        }
    }

    static void add_if_visible(const SampleContext& c, const std::optional<Join>& j, Workspace& work) {
        if (!j) return;
        const float Tr = visibility(c.scene, *j, work.stats);
        if (!(Tr > 0)) return;
        if (j->technique.t <= 1)
            c.sink.add_splat(j->film, j->technique, j->contribution * Tr, j->mis_weight);
        else
            c.sink.add_eye(j->technique, j->contribution * Tr, j->mis_weight);
    }

    DepthOptions depth_;
};

}  // namespace

IntegratorEntry bdpt_entry() {
    return {{"integrator", "bdpt", "Bidirectional path tracing with all connections and MIS. Unbiased.", depth_params()},
            [](const IntegratorParams& p) -> std::unique_ptr<Integrator> {
                return std::make_unique<BdptIntegrator>(DepthOptions::from(p));
            }};
}

}  // namespace etendue
