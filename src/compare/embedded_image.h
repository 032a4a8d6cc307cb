#pragma once
// Images inside an HTML file.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "image/image_io.h"

namespace etendue {

std::string base64(std::string_view bytes);

/// Radiance for a page that sets the exposure itself: half floats with mantissas of eight bits, in a PNG of twice the
/// height whose upper half holds the high bytes and whose lower half the low ones. As a data URI. Finite values beyond
/// the range are clamped.
std::string radiance_data_uri(int width, int height, std::span<const Rgb> pixels);
/// Values in [0, 1] as 8-bit grey.
std::string grey_data_uri(int width, int height, std::span<const float> values);

/// Averages of square blocks, as large as makes the image at most `width` wide.
RgbImage reduced(int width, int height, std::span<const Rgb> pixels, int largest_width);

}  // namespace etendue
