#include "studio/image_reply.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "image/image.h"

namespace etendue {
namespace {

constexpr size_t kHeaderBytes = 64;
constexpr uint32_t kVersion = 1;
constexpr int kMostLevel = 8;
/// Half floats end at 65504.
constexpr float kLargest = 32768;

void put(std::string& to, size_t at, uint32_t value) {
    for (size_t i = 0; i < 4; ++i) to[at + i] = char(value >> (8 * i) & 0xff);
}

template <int channels, class Pixel>
std::string encode(const ImageHeader& h, std::span<const Pixel> pixels) {
    check(h);
    const auto value = [](const Pixel& p, int c) {
        if constexpr (channels == 1)
            return p;
        else
            return p[c];
    };
    const int block = 1 << h.level;
    const int columns = (h.rect.width + block - 1) / block,
              rows = (h.rect.height + block - 1) / block;
    std::vector<float> values(size_t(columns) * size_t(rows) * channels);
    float largest = 0;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
            const int x0 = column * block, x1 = std::min(x0 + block, h.rect.width);
            const int y0 = row * block, y1 = std::min(y0 + block, h.rect.height);
            const float share = 1 / float((x1 - x0) * (y1 - y0));
            for (int c = 0; c < channels; ++c) {
                float sum = 0;
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x)
                        sum += value(
                            pixels[size_t(h.rect.y + y) * size_t(h.width) + size_t(h.rect.x + x)],
                            c);
                sum *= share;
                values[(size_t(row) * size_t(columns) + size_t(column)) * channels + size_t(c)] =
                    sum;
                if (std::isfinite(sum)) largest = std::max(largest, std::abs(sum));
            }
        }
    int scale = 0;
    if (largest > kLargest) std::frexp(largest / kLargest, &scale);
    std::string out(kHeaderBytes + 2 * values.size(), '\0');
    std::memcpy(out.data(), "ETND", 4);
    const uint32_t fields[] = {kVersion,
                               h.run,
                               uint32_t(h.passes),
                               uint32_t(h.rect.x),
                               uint32_t(h.rect.y),
                               uint32_t(h.rect.width),
                               uint32_t(h.rect.height),
                               uint32_t(h.level),
                               uint32_t(channels),
                               uint32_t(scale),
                               uint32_t(h.width),
                               uint32_t(h.height),
                               uint32_t(columns),
                               uint32_t(rows)};
    for (size_t i = 0; i < std::size(fields); ++i) put(out, 4 + 4 * i, fields[i]);
    const float factor = std::ldexp(1.0f, -scale);
    for (size_t i = 0; i < values.size(); ++i) {
        const uint16_t bits = Half(values[i] * factor).bits();
        out[kHeaderBytes + 2 * i] = char(bits & 0xff);
        out[kHeaderBytes + 2 * i + 1] = char(bits >> 8);
    }
    return out;
}

}  // namespace

void check(const ImageHeader& h) {
    const ImageRect& r = h.rect;
    if (h.level < 0 || h.level > kMostLevel) throw std::runtime_error("level must be 0 to 8");
    // Without sums that could overflow.
    if (r.x < 0 || r.y < 0 || r.width < 1 || r.height < 1 || r.x >= h.width || r.y >= h.height ||
        r.width > h.width - r.x || r.height > h.height - r.y)
        throw std::runtime_error("the rectangle is not within the image");
}

std::string encode_image(const ImageHeader& header, std::span<const Rgb> pixels) {
    return encode<3>(header, pixels);
}
std::string encode_image(const ImageHeader& header, std::span<const float> pixels) {
    return encode<1>(header, pixels);
}

}  // namespace etendue
