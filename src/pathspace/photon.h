#pragma once
// What density estimation needs of a light vertex.

#include "color/rgb.h"
#include "math/vec.h"

namespace etendue {

class Emitter;

/// Flux that arrives at a surface point.
struct Photon {
    Vec3 p;
    Vec3 wi;  ///< Toward where it came from.
    Rgb power;
    const Emitter* emitter;
    int s;  ///< Vertices of its path, from y_0 to this one.
};

}  // namespace etendue
