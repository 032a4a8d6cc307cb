#pragma once
// Parameters of radii that shrink from pass to pass.

#include <optional>

#include "integrator/integrator.h"
#include "reuse/radius_schedule.h"

namespace etendue {

/// `doc` is the description of the parameter `radius`.
std::vector<ParamInfo> radius_params(const char* doc);

/// The parameter `radius`, in units of the scene; 0: the default of the method. Throws where its square, or the inverse of its
/// square, would leave the range of float.
float radius_param(const IntegratorParams& params);

/// Values given by the user.
struct RadiusParams {
    float first;  ///< Radius of the first pass; 0: the default of the method.
    float alpha;

    explicit RadiusParams(const IntegratorParams& params);
    /// Radius of pass `index`; by default that of the first pass is default_merge_radius().
    float radius(const Scene& scene, uint32_t index);
    bool shrinks() const { return alpha < 1; }

private:
    std::optional<float> default_;  ///< default_merge_radius(), once it is needed.
};

/// Default radius of merges in the first pass: that of a disc with the area of 36 pixels as the median pixel sees the
/// scene, but at most 1 % of seen_radius(). So the number of photons in a disc does not grow with the
/// resolution if there is one light path for each pixel, and small images are not blurred. Independent of the crop.
float default_merge_radius(const Scene& scene);

}  // namespace etendue
