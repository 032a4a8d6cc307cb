#pragma once

#include "math/dual.h"

namespace etendue {

/// Differential geometry in double at the point where a line meets a primitive. The derivatives are those by any two
/// parameters of the surface.
struct SurfaceJet {
    Vec3d p;
    Vec3d ng;  ///< Unit geometric normal, on the side that SurfaceGeometry has.
    Vec3d ns;  ///< Unit interpolated normal, of the same sign as there.
    Vec3d dpdu, dpdv;
    Vec3d dnsdu, dnsdv;
};

/// What SurfaceGeometry has for textures, with derivatives by the parameters of a SurfaceJet.
struct TextureJet {
    Vec2Dual uv, second_uv;
    Vec3Dual dpdu, dpdv;  ///< Derivatives of p by uv.
};

}  // namespace etendue
