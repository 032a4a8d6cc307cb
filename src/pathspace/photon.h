#pragma once
// The data of a light vertex that density estimation needs.

#include "color/rgb.h"
#include "math/vec.h"

namespace etendue {

class Emitter;

/// Flux that arrives at a surface point.
struct Photon {
    Vec3 p;
    Vec3 wi;  ///< Toward its origin, unit length.
    Rgb power;
    const Emitter* emitter;
    int s;  ///< Vertices of its path, from y_0 to this one.
};

}  // namespace etendue
