#pragma once
// Images as the page reads them: 64 bytes, then half floats row by row.

#include <cstdint>
#include <span>
#include <string>

#include "color/rgb.h"

namespace etendue {

struct ImageRect {
    int x = 0, y = 0, width = 0, height = 0;
};

/// An image of one or three channels, without its pixels.
struct ImageHeader {
    uint32_t run = 0;
    uint64_t passes = 0;
    int width = 0, height = 0;  ///< Of the whole image.
    ImageRect rect;             ///< The part that is sent, in its pixels.
    int level = 0;              ///< Blocks of 2^level pixels each way are averaged.
};

/// Throws std::runtime_error where rectangle or level lie outside the image.
void check(const ImageHeader& header);
/// The reply's body for `width · height` pixels. Values are divided by a power of two, stored in the header, where they
/// exceed the range of half floats.
std::string encode_image(const ImageHeader& header, std::span<const Rgb> pixels);
/// The same for one channel.
std::string encode_image(const ImageHeader& header, std::span<const float> pixels);

}  // namespace etendue
