#pragma once
// Images as the page reads them: 64 bytes, then half floats row by row.

#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

#include "color/rgb.h"

namespace etendue {

struct ImageRect {
    int x = 0, y = 0, width = 0, height = 0;
};

/// Pixels row by row, of which there are as many as the size says.
template <class Pixel>
class PixelRows {
public:
    PixelRows(std::span<const Pixel> pixels, int width, int height)
        : pixels_(pixels), width_(width), height_(height) {
        if (width < 0 || height < 0 || pixels.size() != size_t(width) * size_t(height))
            throw std::logic_error("an image has another number of pixels than its size says");
    }
    int width() const { return width_; }
    int height() const { return height_; }
    const Pixel& at(int x, int y) const { return pixels_[size_t(y) * size_t(width_) + size_t(x)]; }

private:
    std::span<const Pixel> pixels_;
    int width_, height_;
};

/// Which part of an image is sent, and of what.
struct ImagePart {
    uint32_t run = 0;
    uint64_t passes = 0;
    std::optional<ImageRect> rect;  ///< In pixels; empty: all of it.
    int level = 0;                  ///< Blocks of 2^level pixels each way are averaged.
};

/// Throws std::runtime_error where a rectangle lies outside of an image of this size.
void check(const ImageRect& rect, int width, int height);
/// The reply's body. Values are divided by a power of two, stored in the header, so that the largest is near the end of the
/// range of half floats. Throws std::runtime_error where rectangle or level are not those of the image.
std::string encode_image(const ImagePart& part, const PixelRows<Rgb>& pixels);
/// The same for one channel.
std::string encode_image(const ImagePart& part, const PixelRows<float>& pixels);

}  // namespace etendue
