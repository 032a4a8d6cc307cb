#pragma once
// The field of view of perspective cameras, and of emitters that project like one.

#include <vector>

#include "description/params.h"

namespace etendue {

/// Parameters fov, fov_axis, aspect and focal_length. `aspect` names what determines the aspect ratio otherwise.
std::vector<ParamInfo> view_params(const char* aspect);
/// Half the width of the view on the plane at the distance 1; `aspect` is its width over its height.
double view_half_width(const Params& params, double aspect);

}  // namespace etendue
