#pragma once

#include <vector>

#include "emitter/infinite.h"
#include "math/transform.h"

namespace etendue {

/// Environment given by a latitude-longitude image of radiance: rows from +y to -y, columns by azimuth from -z over +x.
/// Interpolated bilinearly, and importance-sampled by luminance. `to_world` is a rotation.
std::unique_ptr<Emitter> make_environment(int width, int height, std::vector<Rgb> pixels,
                                          const Transform& to_world);

}  // namespace etendue
