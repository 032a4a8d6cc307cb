#pragma once

#include <memory>
#include <string>

#include "integrator/integrator.h"
#include "manifold/specular_connection.h"

namespace etendue {

/// Specular connections as an option of integrators.
class Specular {
public:
    static std::vector<ParamInfo> params();
    Specular() = default;
    explicit Specular(const IntegratorParams& params);

    /// Before pass 0, decides with `specular_connections=auto` whether the rendering uses specular connections, and traces the
    /// photons from which searches begin. `counts`: those of the method where it does. For Integrator::prepare().
    void prepare(const PassContext& pass, const DepthOptions& depth, TechniqueCounts counts);
    /// Whether prepare() prepares anything for this scene.
    bool is_prepared_for(const Scene& scene) const {
        return mode_ != Mode::Off && scene.may_have_chains();
    }
    void save(LearnedState& to) const;
    void load(LearnedState& from);
    /// See Integrator::figures().
    void add_figures(std::vector<std::pair<std::string, double>>& figures) const;

    /// TechniqueCounts::specular_depth: 0 where the scene has nothing that a chain could consist of. Before prepare(), that of
    /// a rendering that uses them.
    int depth(const Scene& scene) const { return is_used_ && scene.may_have_chains() ? depth_ : 0; }
    /// Adds the hit, times `factor`, with the weight that it has beside specular connections.
    static void add_hit(const SampleContext& c, const Join& hit, const SubPath& z, int t,
                        const TechniqueCounts& counts, float factor = 1) {
        if (counts.specular_depth == 0) return c.sink.add(hit, hit.contribution * factor);
        Join join = hit;
        join.mis_weight *= hit_beside_specular(c.scene, z, t, *hit.emitter, counts);
        c.sink.add(join, join.contribution * factor);
    }
    /// Gives a hit of the lens, C(s+1,0), the weight that it has beside specular connections.
    static void weigh_hit_lens(Join& hit, const Scene& scene, const SubPath& y, int s,
                               const TechniqueCounts& counts) {
        if (counts.specular_depth > 0)
            hit.mis_weight *= hit_lens_beside_specular(scene, y, s, counts);
    }
    /// Adds X(s,t) of z_{t-1}, where the counts have any. `threshold`: as SpecularLimits::threshold; where it is 0, because
    /// nothing is known of the pixel yet, it is `roulette` times the image's mean in the pilot.
    void add(const SampleContext& c, int t, int max_depth, float threshold, float roulette,
             const TechniqueCounts& counts, Workspace& work) const {
        const SpecularLimits limits{.max_depth = max_depth,
                                    .threshold = threshold > 0 ? threshold : roulette * luminance_,
                                    .photons = photons_.get()};
        if (const auto j = join_specular(c.scene, work.z, t, limits, c.sampler, counts, work))
            c.sink.add(*j, j->contribution);
    }

private:
    enum class Mode : uint8_t { Off, On, Auto };
    Mode mode_ = Mode::Off;
    bool is_used_ = false;
    int depth_ = 0;
    float luminance_ = 0;  ///< Mean of the image in the pilot.
    std::shared_ptr<const SeedPhotons> photons_;
    std::string method_;
    std::shared_ptr<SharedByPilots> pilots_;  ///< Null in renderings that are no pilots.
};

}  // namespace etendue
