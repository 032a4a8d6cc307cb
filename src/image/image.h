#pragma once
// Pixels with named channels, in linear floats; and pixels as a file stores them.

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Imath/half.h>

#include "color/rgb.h"

namespace etendue {

/// Rows from the top, the channels of a pixel adjacent; colours are linear. Channels of a layer are prefixed with its
/// name: "albedo.R".
struct Image {
    int width = 0, height = 0;
    std::vector<std::string> channels;
    std::vector<float> data;
    /// Metadata stored in EXR files.
    std::map<std::string, std::variant<std::string, double>> attributes;

    Image() = default;
    Image(int width, int height, std::vector<std::string> channels);  ///< Black.

    size_t pixel_count() const { return size_t(width) * height; }
    float& at(int x, int y, int c) { return data[offset(x, y) + c]; }
    float at(int x, int y, int c) const { return data[offset(x, y) + c]; }
    int channel(std::string_view name) const;  ///< Index, or -1.
    /// Names of the layers in order of appearance; "" for channels without a prefix.
    std::vector<std::string> layers() const;

private:
    size_t offset(int x, int y) const { return (size_t(y) * width + x) * channels.size(); }
};

/// The colours of a layer: its channels R, G and B, or its channel Y or its only one as grey. Throws std::runtime_error
/// where it has none of these.
std::vector<Rgb> rgb_pixels(const Image& image, std::string_view layer = "");
/// Appends the channels R, G, B (prefixed with "layer." unless that is empty); an empty image takes the given size.
void add_rgb_layer(Image& image, int width, int height, std::string_view layer,
                   std::span<const Rgb> pixels);
Image rgb_image(int width, int height, std::span<const Rgb> pixels);
/// An image of several layers, whose memory is allocated once.
struct RgbLayer {
    std::string name;  ///< Empty: the channels have no prefix.
    std::span<const Rgb> pixels;
};
Image layered_image(int width, int height, std::span<const RgbLayer> layers);

using Half = Imath::half;

/// Pixels in the file's own precision: 8-bit codes, or linear values of 16 or 32 bits. Rows from the top, the channels
/// of a pixel adjacent; alpha is not premultiplied.
struct PixelBuffer {
    int width = 0, height = 0, channels = 0;
    std::variant<std::vector<uint8_t>, std::vector<Half>, std::vector<float>> data;
    int alpha_channel = -1;  ///< Index, or -1.

    size_t memory_bytes() const;
};

}  // namespace etendue
