#pragma once

#include <vector>

#include "emitter/infinite.h"
#include "math/transform.h"

namespace etendue {

/// Radiance over all directions as a latitude-longitude image: rows from +y to -y, columns by azimuth from -z over +x;
/// interpolated bilinearly and importance-sampled by luminance.
std::unique_ptr<Emitter> make_environment(int width, int height, std::vector<Rgb> pixels,
                                          const Transform& to_world);

}  // namespace etendue
