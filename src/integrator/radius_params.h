#pragma once
// Parameters of radii that shrink from pass to pass.

#include "integrator/integrator.h"
#include "reuse/radius_schedule.h"

namespace etendue {

/// `doc` is the description of the parameter `radius`.
std::vector<ParamInfo> radius_params(const char* doc);

/// Values given by the user.
struct RadiusParams {
    float first;  ///< Radius of the first pass; 0: the default of the method.
    float alpha;

    explicit RadiusParams(const IntegratorParams& params);
    RadiusSchedule schedule(float default_radius) const {
        return {first > 0 ? first : default_radius, alpha};
    }
    bool shrinks() const { return alpha < 1; }
};

/// Radius of a disc with the area of a pixel, projected to the first surface: the median over the image. Independent of
/// the crop. 0 if no eye ray hits a surface.
float pixel_radius(const Scene& scene);

}  // namespace etendue
