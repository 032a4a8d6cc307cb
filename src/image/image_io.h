#pragma once
// Image files. Every function throws std::runtime_error with one message that names the file.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"
#include "system/output_file.h"

namespace etendue {

/// Reads .exr (flat, its first part), .png, .jpg, .hdr, .pfm, .tga, .bmp, .pgm and .ppm. The content decides, not the name.
/// Integer formats are decoded from sRGB, except alpha, whatever the file says about its codes.
Image read_image(const std::string& path);
/// The same for the bytes of a file; `name` is its name in messages.
Image decode_image(const std::string& bytes, const std::string& name);

/// The colours of one layer; see rgb_pixels().
struct RgbImage {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;
};
RgbImage read_rgb(const std::string& path, std::string_view layer = "");
RgbImage decode_rgb(const std::string& bytes, const std::string& name);

/// Reads pixels for a texture in the file's own precision: the colours of rgb_channels(), one channel where they are grey,
/// and alpha behind them. 8-bit formats stay codes; deeper integer formats become floats, decoded from sRGB unless `raw`.
PixelBuffer read_pixels(const std::string& path, bool raw);
/// The same for the bytes of a file; `name` is its name in messages.
PixelBuffer decode_pixels(const std::string& bytes, const std::string& name, bool raw);

enum class ExrPrecision { Float, Half };

struct WriteOptions {
    ExrPrecision precision = ExrPrecision::Float;
    Links links = Links::Follow;
    /// Of an .exr file, which they compress. A process that has used several must not write such files after fork().
    int threads = 1;
};

/// Writes the format given by the name's extension: .exr stores all channels and attributes; .pfm, .hdr and .png (sRGB,
/// clamped, NaN as magenta) store the colours of the unnamed layer. The file is an OutputFile. With ExrPrecision::Half
/// finite values are clamped to the range of half floats.
void write_image(const std::string& path, const ImageRows& image, const WriteOptions& options = {});
inline void write_image(const std::string& path, const Image& image,
                        const WriteOptions& options = {}) {
    write_image(path, rows_of(image), options);
}

/// The 8-bit sRGB codes that write_image() stores in a .png: colours are clamped, NaN is magenta.
std::vector<uint8_t> srgb_codes(std::span<const Rgb> pixels);

/// The bytes of a PNG file with these 8-bit sRGB codes, of one (grey) or three channels. Throws if their number is not
/// that of an image with at least one pixel.
std::string encode_png(int width, int height, std::span<const uint8_t> codes);

/// The number of channels of `codes` values: 1 or 3. Throws std::runtime_error for others, and for an empty image.
int png_channels(int width, int height, size_t codes);

/// The extension of a file name in lower case, with its dot: ".exr".
std::string image_extension(const std::string& path);

/// Throws unless write_image() supports the extension; for a check before a long rendering.
void check_image_extension(const std::string& path);

}  // namespace etendue
