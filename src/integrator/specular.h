#pragma once

#include "integrator/integrator.h"
#include "manifold/specular_connection.h"

namespace etendue {

/// Specular connections as an option of integrators.
class Specular {
public:
    static std::vector<ParamInfo> params();
    Specular() = default;
    explicit Specular(const IntegratorParams& params);

    bool is_on() const { return depth_ > 0; }
    /// TechniqueCounts::specular_depth.
    int depth() const { return depth_; }
    /// The hit with the weight that it has beside specular connections.
    Join weighed_hit(const Join& hit, const Scene& scene, const SubPath& z, int t,
                     const TechniqueCounts& counts) const {
        Join join = hit;
        if (is_on()) join.mis_weight *= hit_beside_specular(scene, z, t, *hit.emitter, counts);
        return join;
    }
    /// The same for a hit of the lens, C(s+1,0).
    void weigh_hit_lens(Join& hit, const Scene& scene, const SubPath& y, int s,
                        const TechniqueCounts& counts) const {
        if (is_on()) hit.mis_weight *= hit_lens_beside_specular(scene, y, s, counts);
    }
    /// Adds X(s,t) of z_{t-1}.
    void add(const SampleContext& c, int t, int max_depth, const TechniqueCounts& counts,
             Workspace& work) const;

private:
    int depth_ = 0;
};

}  // namespace etendue
