#pragma once
// Parameters of radii that shrink from pass to pass.

#include "integrator/integrator.h"
#include "reuse/radius_schedule.h"

namespace etendue {

/// `doc`: of the first radius.
std::vector<ParamInfo> radius_params(const char* doc);

/// What the user gave.
struct RadiusParams {
    float first;  ///< 0: the method's default.
    float alpha;

    explicit RadiusParams(const IntegratorParams& params);
    RadiusSchedule schedule(float default_radius) const {
        return {first > 0 ? first : default_radius, alpha};
    }
    bool shrinks() const { return alpha < 1; }
};

/// Radius of the disc of a pixel's area where its ray meets the scene: the median over the image. It does not depend on the
/// crop. 0 where no ray meets anything.
float pixel_radius(const Scene& scene);

}  // namespace etendue
