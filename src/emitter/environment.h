#pragma once

#include <vector>

#include "emitter/infinite.h"
#include "image/image_io.h"
#include "math/transform.h"

namespace etendue {

/// Environment given by a latitude-longitude image of radiance: rows from +y to -y, columns by azimuth from -z over +x.
/// Interpolated bilinearly, and importance-sampled by luminance. `to_world` is a rotation.
std::unique_ptr<Emitter> make_environment(int width, int height, std::vector<Rgb> pixels,
                                          const Transform& to_world);

/// The same as a square image of `size`² pixels in the equal-area octahedral projection of pbrt-v4 [Clarberg 2008]; each
/// pixel is a region of one radiance.
std::unique_ptr<Emitter> make_equal_area_environment(int size, std::vector<Rgb> pixels,
                                                     const Transform& to_world);
/// The image of parameter "image" or "filename" times `factor`; throws SceneError where it is no emission.
RgbImage read_emission_image(const Params& params, Rgb factor);
/// An environment of `image` in the projection that parameter "projection" names.
std::unique_ptr<Emitter> make_environment(const Params& params, RgbImage image,
                                          const Transform& to_world);

/// Direction at a point of the unit square in that projection, and back.
Vec3 equal_area_direction(Vec2 square);
Vec2 equal_area_square(Vec3 direction);

}  // namespace etendue
