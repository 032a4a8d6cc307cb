#include "compare/embedded_image.h"

#include <algorithm>
#include <cmath>

#include "image/image.h"

namespace etendue {
namespace {

constexpr float kMaxHalf = 65504;

/// Rounds to a half float whose two lowest bits are zero: they are invisible, and would not compress.
uint16_t short_half(float v) {
    if (std::isfinite(v)) v = std::clamp(v, -kMaxHalf, kMaxHalf);
    const uint16_t bits = Half(v).bits();
    const auto rounded = uint16_t((bits + 2) & ~3);
    constexpr uint16_t kLargest = 0x7bfc;
    const bool overflows = std::isfinite(v) && (rounded & 0x7fff) > kLargest;
    return overflows ? uint16_t((bits & 0x8000) | kLargest) : rounded;
}

std::string png_data_uri(const std::string& png) {
    return "data:image/png;base64," + base64(png);
}

}  // namespace

std::string base64(std::string_view bytes) {
    constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (size_t i = 0; i < bytes.size(); i += 3) {
        const size_t count = std::min<size_t>(3, bytes.size() - i);
        uint32_t group = 0;
        for (size_t k = 0; k < 3; ++k)
            group = group << 8 | (k < count ? uint8_t(bytes[i + k]) : 0u);
        for (size_t k = 0; k < 4; ++k)
            out += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
    }
    return out;
}

std::string radiance_data_uri(int width, int height, std::span<const Rgb> pixels) {
    std::vector<uint8_t> codes(pixels.size() * 6);
    for (size_t i = 0; i < pixels.size(); ++i)
        for (int c = 0; c < 3; ++c) {
            const uint16_t half = short_half(pixels[i][c]);
            codes[i * 3 + c] = uint8_t(half >> 8);
            codes[(pixels.size() + i) * 3 + c] = uint8_t(half & 255);
        }
    return png_data_uri(encode_png(width, height * 2, codes));
}

std::string grey_data_uri(int width, int height, std::span<const float> values) {
    std::vector<uint8_t> codes;
    for (float v : values) codes.push_back(uint8_t(std::clamp(v, 0.0f, 1.0f) * 255 + 0.5f));
    return png_data_uri(encode_png(width, height, codes));
}

RgbImage reduced(int width, int height, std::span<const Rgb> pixels, int largest_width) {
    const int block = (width + largest_width - 1) / largest_width;
    RgbImage out{std::max(1, width / block), std::max(1, height / block), {}};
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            Rgb sum;
            int count = 0;
            for (int v = y * block; v < std::min(height, (y + 1) * block); ++v)
                for (int u = x * block; u < std::min(width, (x + 1) * block); ++u, ++count)
                    sum += pixels[size_t(v) * width + u];
            out.pixels.push_back(sum / float(count));
        }
    return out;
}

}  // namespace etendue
