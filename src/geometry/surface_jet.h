#pragma once

#include "math/vec3d.h"

namespace etendue {

/// Differential geometry in double at the point where a line meets a primitive. The derivatives are those by any two
/// parameters of the surface.
struct SurfaceJet {
    Vec3d p;
    Vec3d ng;  ///< Unit geometric normal, of either sign.
    Vec3d ns;  ///< Unit interpolated normal, of either sign.
    Vec3d dpdu, dpdv;
    Vec3d dnsdu, dnsdv;
};

}  // namespace etendue
