#pragma once
// What the readers of all image formats have in common.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "image/image.h"
#include "system/available_memory.h"

namespace etendue {

/// The bytes of a file, and its name for messages.
struct ImageSource {
    std::string name;
    std::string_view bytes;
};

[[noreturn]] void fail_read(const std::string& path, const std::string& why);
/// Calls read(), which makes something of an image file, and fails where it does not fit into memory.
template <class Read>
auto decode_in_memory(const std::string& path, const Read& read) {
    return in_memory(read, [&](const char* why) { fail_read(path, why); });
}

/// Throws if a header claims an image that is empty, or too large for its file or the memory.
void check_image_size(const ImageSource& source, uint64_t width, uint64_t height,
                      uint64_t pixel_bytes);

/// What a file holds, before any conversion of colours.
struct ImageContents {
    PixelBuffer pixels;
    std::vector<std::string> channels;
    bool is_linear = true;    ///< Whether the values are linear, or sRGB codes.
    double largest_code = 1;  ///< Of integer formats.
    std::map<std::string, std::variant<std::string, double>> attributes;
};

/// Linear values, with channels by their number: Y, YA, RGB or RGBA.
ImageContents radiance_of(int width, int height, int channels, std::vector<float> values);
/// sRGB codes of 8 bits.
ImageContents coded(int width, int height, int channels, std::vector<uint8_t> codes);
/// sRGB codes as numbers in [0, 1].
ImageContents deeply_coded(int width, int height, int channels, std::vector<float> values);

}  // namespace etendue
