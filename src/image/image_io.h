#pragma once
// Image files. Every function throws std::runtime_error with one message that names the file.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"

namespace etendue {

/// Reads any format OpenImageIO knows. Integer formats are taken as sRGB (alpha as linear) and linearised.
Image read_image(const std::string& path);

/// The colours of one layer; see rgb_pixels().
struct RgbImage {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;
};
RgbImage read_rgb(const std::string& path, std::string_view layer = "");

/// Reads pixels for a texture in the file's own precision. Integer formats are codes of sRGB unless `raw`: 8-bit ones
/// stay codes, deeper ones become floats, linearised unless `raw`.
PixelBuffer read_pixels(const std::string& path, bool raw);

enum class ExrPrecision { Float, Half };

/// Writes by the name's extension: .exr takes all channels and attributes; .pfm, .hdr and .png (sRGB, clamped, NaN in
/// magenta) take the colours without a layer. Missing folders are made. The file appears, or is replaced, only once it
/// is complete. Finite values beyond the range of half floats are clamped to it.
void write_image(const std::string& path, const Image& image,
                 ExrPrecision precision = ExrPrecision::Float);

/// The bytes of a PNG file with these 8-bit codes, of one (grey) or three channels. Codes of colours are sRGB.
std::string encode_png(int width, int height, std::span<const uint8_t> codes);

/// Throws unless write_image knows the extension: to be called before a long rendering.
void check_image_extension(const std::string& path);

}  // namespace etendue
