#pragma once
// Images embedded in an HTML file as data URIs.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "color/rgb.h"
#include "image/image_io.h"

namespace etendue {

std::string base64(std::string_view bytes);

/// Radiance, for a page with its own exposure control, as half floats with 8-bit mantissas. The PNG has twice the
/// height: the upper half contains the high bytes, the lower half the low bytes. Finite values are clamped to the
/// range.
std::string radiance_data_uri(int width, int height, std::span<const Rgb> pixels);
/// Values in [0, 1] as 8-bit grey.
std::string grey_data_uri(int width, int height, std::span<const float> values);

/// The image averaged over square blocks, so that it is at most about `largest_width` pixels wide.
RgbImage reduced(int width, int height, std::span<const Rgb> pixels, int largest_width);

}  // namespace etendue
