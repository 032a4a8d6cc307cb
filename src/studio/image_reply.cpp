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
std::string encode(const ImagePart& part, const PixelRows<Pixel>& pixels) {
    if (part.level < 0 || part.level > kMostLevel) throw std::runtime_error("level must be 0 to 8");
    const ImageRect rect = part.rect.value_or(ImageRect{0, 0, pixels.width(), pixels.height()});
    check(rect, pixels.width(), pixels.height());
    const auto value = [](const Pixel& p, int c) {
        if constexpr (channels == 1)
            return p;
        else
            return p[c];
    };
    const int block = 1 << part.level;
    const int columns = (rect.width + block - 1) / block, rows = (rect.height + block - 1) / block;
    std::vector<float> values(size_t(columns) * size_t(rows) * channels);
    float largest = 0;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
            const int x0 = column * block, x1 = std::min(x0 + block, rect.width);
            const int y0 = row * block, y1 = std::min(y0 + block, rect.height);
            const float share = 1 / float((x1 - x0) * (y1 - y0));
            for (int c = 0; c < channels; ++c) {
                float sum = 0;
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x)
                        sum += value(pixels.at(rect.x + x, rect.y + y), c);
                sum *= share;
                values[(size_t(row) * size_t(columns) + size_t(column)) * channels + size_t(c)] =
                    sum;
                if (std::isfinite(sum)) largest = std::max(largest, std::abs(sum));
            }
        }
    int scale = 0;
    // Small values have few digits as half floats, none below 6e-8; those of a variance are smaller than that.
    if (largest > 0) std::frexp(largest / kLargest, &scale);
    constexpr int kLeastScale = -120;  // 2^120 is a float
    scale = std::max(scale, kLeastScale);
    std::string out(kHeaderBytes + 2 * values.size(), '\0');
    std::memcpy(out.data(), "ETND", 4);
    const uint32_t fields[] = {kVersion,
                               part.run,
                               uint32_t(part.passes),
                               uint32_t(rect.x),
                               uint32_t(rect.y),
                               uint32_t(rect.width),
                               uint32_t(rect.height),
                               uint32_t(part.level),
                               uint32_t(channels),
                               uint32_t(scale),  // of either sign
                               uint32_t(pixels.width()),
                               uint32_t(pixels.height()),
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

void check(const ImageRect& r, int width, int height) {
    // Without sums that could overflow.
    if (r.x < 0 || r.y < 0 || r.width < 1 || r.height < 1 || r.x >= width || r.y >= height ||
        r.width > width - r.x || r.height > height - r.y)
        throw std::runtime_error("the rectangle is not within the image");
}

std::string encode_image(const ImagePart& part, const PixelRows<Rgb>& pixels) {
    return encode<3>(part, pixels);
}
std::string encode_image(const ImagePart& part, const PixelRows<float>& pixels) {
    return encode<1>(part, pixels);
}

}  // namespace etendue
