#pragma once
// Pixels with named channels, in linear floats; and pixels as a file stores them.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Imath/half.h>

#include "color/rgb.h"

namespace etendue {

/// Metadata stored in EXR files.
using ImageAttributes = std::map<std::string, std::variant<std::string, double>>;

/// Rows from the top, the channels of a pixel adjacent; colours are linear. Channels of a layer are prefixed with its
/// name: "albedo.R".
struct Image {
    int width = 0, height = 0;
    std::vector<std::string> channels;
    std::vector<float> data;
    ImageAttributes attributes;

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

/// The colours of a layer; see rgb_channels().
std::vector<Rgb> rgb_pixels(const Image& image, std::string_view layer = "");
/// Appends the names of the channels R, G, B, prefixed with "layer." unless that is empty.
void add_rgb_channels(std::string_view layer, std::vector<std::string>& channels);
/// Appends such channels; an empty image takes the given size.
void add_rgb_layer(Image& image, int width, int height, std::string_view layer,
                   std::span<const Rgb> pixels);
Image rgb_image(int width, int height, std::span<const Rgb> pixels);
/// An image of several layers, whose memory is allocated once.
struct RgbLayer {
    std::string name;  ///< Empty: the channels have no prefix.
    std::span<const Rgb> pixels;
};
Image layered_image(int width, int height, std::span<const RgbLayer> layers);

/// Where the colours of a layer are among the channels of an image.
struct RgbChannels {
    int index[3];

    Rgb of(const float* pixel) const { return {pixel[index[0]], pixel[index[1]], pixel[index[2]]}; }
};
/// The channels R, G and B, or the channel Y or the only one as grey. Throws std::runtime_error where there are none of these.
RgbChannels rgb_channels(const std::vector<std::string>& channels, std::string_view layer = "");

/// An image whose rows are made one by one, so that it needs no memory for its pixels. What `make` reads must outlive it.
struct ImageRows {
    int width = 0, height = 0;
    std::vector<std::string> channels;
    ImageAttributes attributes;
    /// Sets `to` to the row `y`, as Image has it.
    std::function<void(int y, std::span<float> to)> make;
};
ImageRows rows_of(const Image& image);
Image to_image(const ImageRows& rows);
/// Calls `use(y, row)` for the colours of the rows from the top; see rgb_channels().
template <class Use>
void for_each_rgb_row(const ImageRows& rows, const Use& use) {
    const RgbChannels rgb = rgb_channels(rows.channels);
    std::vector<float> values(size_t(rows.width) * rows.channels.size());
    std::vector<Rgb> row(size_t(rows.width));
    for (int y = 0; y < rows.height; ++y) {
        rows.make(y, values);
        for (size_t x = 0; x < row.size(); ++x) row[x] = rgb.of(&values[x * rows.channels.size()]);
        use(y, std::span<Rgb>(row));
    }
}

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
