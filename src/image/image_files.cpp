// The parts of image_io.h that need no library.

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include <fmt/format.h>

#include "color/srgb.h"
#include "image/image_codecs.h"
#include "image/image_contents.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_write(const std::string& path, const std::string& why) {
    throw std::runtime_error(fmt::format("cannot write \"{}\": {}", path, why));
}

// Portable float map: rows from the bottom, little-endian where the scale is negative.
void write_pfm(OutputFile& file, const ImageRows& image, const WriteOptions&) {
    static_assert(std::endian::native == std::endian::little);
    const bool is_grey = image.channels.size() == 1;
    const RgbChannels rgb = rgb_channels(image.channels);
    file.write(fmt::format("{}\n{} {}\n-1.0\n", is_grey ? "Pf" : "PF", image.width, image.height));
    const size_t channels = image.channels.size();
    std::vector<float> values(size_t(image.width) * channels), row;
    for (int y = image.height - 1; y >= 0; --y) {
        image.make(y, values);
        row.clear();
        for (size_t x = 0; x < size_t(image.width); ++x) {
            const Rgb c = rgb.of(&values[x * channels]);
            for (int i = 0; i < (is_grey ? 1 : 3); ++i) row.push_back(c[i]);
        }
        file.write(row.data(), row.size() * sizeof(float));
    }
}

// Radiance's format: a common exponent for each pixel [Ward 1991].
void to_rgbe(const Rgb& c, uint8_t* code) {
    constexpr float kMost = 0x1.fep126f;  // 255/256 of 2^127
    float largest = 0;
    for (int i = 0; i < 3; ++i)  // without NaN
        if (c[i] > largest) largest = std::min(c[i], kMost);
    std::fill(code, code + 4, uint8_t(0));
    if (!(largest > 1e-32f)) return;
    int exponent = 0;
    const float scale = std::frexp(largest, &exponent) * 256 / largest;
    for (int i = 0; i < 3; ++i)  // 0 for NaN, too
        code[i] = c[i] > 0 ? uint8_t(std::min(c[i] * scale + 0.5f, 255.0f)) : uint8_t(0);
    code[3] = uint8_t(exponent + 128);
}

void write_hdr(OutputFile& file, const ImageRows& image, const WriteOptions&) {
    const size_t width = size_t(image.width);
    file.write(fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", image.height,
                           image.width));
    // With run lengths, all of them runs of different bytes, since a plain row could look as if it had them.
    const bool has_runs = width >= 8 && width < 32768;
    std::vector<uint8_t> row(4 * width);
    std::string bytes;
    for_each_rgb_row(image, [&](int, std::span<const Rgb> colours) {
        for (size_t x = 0; x < width; ++x) to_rgbe(colours[x], &row[4 * x]);
        bytes.clear();
        if (has_runs) {
            for (const size_t b : {size_t(2), size_t(2), width >> 8, width & 255}) bytes += char(b);
            for (size_t c = 0; c < 4; ++c)
                for (size_t x = 0; x < width; x += 128) {
                    const size_t end = std::min(x + 128, width);
                    bytes += char(end - x);
                    for (size_t i = x; i < end; ++i) bytes += char(row[4 * i + c]);
                }
        } else {
            bytes.assign(row.begin(), row.end());
        }
        file.write(bytes);
    });
}

uint8_t srgb_code(float v) {
    return uint8_t(linear_to_srgb(std::clamp(v, 0.0f, 1.0f)) * 255 + 0.5f);
}

struct Writer {
    const char* extension;
    bool stores_all_channels;
    void (*write)(OutputFile& file, const ImageRows& image, const WriteOptions& options);
};
constexpr Writer kWriters[] = {{".exr", true, write_exr},
                               {".pfm", false, write_pfm},
                               {".hdr", false, write_hdr},
                               {".png", false, write_png}};

const Writer& writer_for(const std::string& path) {
    const std::string e = image_extension(path);
    for (const Writer& w : kWriters)
        if (e == w.extension) return w;
    fail_write(path,
               fmt::format("its name must end in .exr, .pfm, .hdr or .png, not in \"{}\"", e));
}

RgbImage colours_of(const Image& image, const std::string& name, std::string_view layer) {
    return decode_in_memory(name, [&]() -> RgbImage {
        try {
            return {image.width, image.height, rgb_pixels(image, layer)};
        } catch (const std::runtime_error& e) {
            fail_read(name, e.what());
        }
    });
}

}  // namespace

std::vector<uint8_t> srgb_codes(std::span<const Rgb> pixels) {
    std::vector<uint8_t> codes;
    codes.reserve(3 * pixels.size());
    for (const Rgb& c : pixels)
        if (std::isnan(c.r) || std::isnan(c.g) || std::isnan(c.b))
            codes.insert(codes.end(), {255, 0, 255});
        else
            codes.insert(codes.end(), {srgb_code(c.r), srgb_code(c.g), srgb_code(c.b)});
    return codes;
}

int png_channels(int width, int height, size_t codes) {
    if (width > 0 && height > 0)
        for (const int channels : {1, 3})
            if (codes == size_t(width) * size_t(height) * size_t(channels)) return channels;
    throw std::runtime_error(fmt::format("cannot encode a PNG of {} x {} pixels from {} values; "
                                         "expected one or three values for each pixel",
                                         width, height, codes));
}

std::string image_extension(const std::string& path) {
    std::string e = fs::path(path).extension().string();
    std::transform(e.begin(), e.end(), e.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return e;
}

RgbImage read_rgb(const std::string& path, std::string_view layer) {
    return colours_of(read_image(path), path, layer);
}

RgbImage decode_rgb(const std::string& bytes, const std::string& name) {
    return colours_of(decode_image(bytes, name), name, "");
}

void check_image_extension(const std::string& path) {
    writer_for(path);
}

void write_image(const std::string& path, const ImageRows& image, const WriteOptions& options) {
    const Writer& writer = writer_for(path);
    if (image.width < 1 || image.height < 1 || image.channels.empty())
        fail_write(path, "the image is empty");
    if (!writer.stores_all_channels) try {
            rgb_channels(image.channels);
        } catch (const std::runtime_error& e) {
            fail_write(path, e.what());
        }
    OutputFile file(path, options.links);
    writer.write(file, image, options);
    file.commit();
}

}  // namespace etendue
