#pragma once
// Parameters of radii that shrink from pass to pass.

#include <optional>

#include "integrator/integrator.h"
#include "reuse/radius_schedule.h"

namespace etendue {

/// `doc` is the description of the parameter `radius`.
std::vector<ParamInfo> radius_params(const char* doc);

/// Values given by the user.
struct RadiusParams {
    float first;  ///< Radius of the first pass; 0: default_merge_radius().
    float alpha;

    /// `pixels`: that of default_merge_radius().
    RadiusParams(const IntegratorParams& params, float pixels);
    /// Radius of pass `index`.
    float radius(const Scene& scene, uint32_t index);
    bool shrinks() const { return alpha < 1; }

private:
    float pixels_;
    std::optional<float> default_;  ///< default_merge_radius(), once it is needed.
};

/// Default radius of merges in the first pass: that of a disc with the area of `pixels` pixels as the median pixel sees
/// the scene, but at most 1 % of the radius of the scene's bounds. So the number of photons in a disc does not grow with
/// the resolution if there is one light path for each pixel, and small images are not blurred. Independent of the crop. A
/// smaller radius makes caustics noisier, a larger one blurs them.
float default_merge_radius(const Scene& scene, float pixels);

}  // namespace etendue
