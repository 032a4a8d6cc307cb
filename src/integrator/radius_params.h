#pragma once
// Parameters of radii that shrink from pass to pass.

#include "integrator/integrator.h"
#include "reuse/radius_schedule.h"

namespace etendue {

/// `doc`: of the first radius.
std::vector<ParamInfo> radius_params(const char* doc);

/// What the user gave; the radius of scene units is known with the scene.
struct RadiusParams {
    float first;  ///< 0: the default share of the radius of the scene's bounds.
    float alpha;
    float default_share;

    RadiusParams(const IntegratorParams& params, float default_share);
    RadiusSchedule schedule(const Scene& scene) const {
        return {first > 0 ? first : default_share * scene.bounds().radius(), alpha};
    }
    bool shrinks() const { return alpha < 1; }
};

}  // namespace etendue
