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

std::vector<Rgb> colours(const OutputFile& file, const Image& image) {
    try {
        return rgb_pixels(image);
    } catch (const std::runtime_error& e) {
        file.fail(e.what());
    }
}

// Portable float map: rows from the bottom, little-endian where the scale is negative.
void write_pfm(OutputFile& file, const Image& image, ExrPrecision) {
    static_assert(std::endian::native == std::endian::little);
    const bool grey = image.channels.size() == 1;
    const std::vector<Rgb> pixels = colours(file, image);
    file.write(fmt::format("{}\n{} {}\n-1.0\n", grey ? "Pf" : "PF", image.width, image.height));
    std::vector<float> row;
    for (int y = image.height - 1; y >= 0; --y) {
        row.clear();
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < (grey ? 1 : 3); ++c)
                row.push_back(pixels[size_t(y) * image.width + x][c]);
        file.write(row.data(), row.size() * sizeof(float));
    }
}

// Radiance's format: a common exponent for each pixel [Ward 1991].
void to_rgbe(const Rgb& c, uint8_t* code) {
    constexpr float kMost = 0x1.fep126f;  // 255/256 of 2^127
    const float largest = std::min(c.max(), kMost);
    std::fill(code, code + 4, uint8_t(0));
    if (!(largest > 1e-32f)) return;
    int exponent = 0;
    const float scale = std::frexp(largest, &exponent) * 256 / largest;
    for (int i = 0; i < 3; ++i)  // 0 for NaN, too
        code[i] = c[i] > 0 ? uint8_t(std::min(c[i] * scale + 0.5f, 255.0f)) : uint8_t(0);
    code[3] = uint8_t(exponent + 128);
}

void write_hdr(OutputFile& file, const Image& image, ExrPrecision) {
    const std::vector<Rgb> pixels = colours(file, image);
    const size_t width = size_t(image.width);
    file.write(fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", image.height,
                           image.width));
    // With run lengths, all of them runs of different bytes, since a plain row could look as if it had them.
    const bool has_runs = width >= 8 && width < 32768;
    std::vector<uint8_t> row(4 * width);
    std::string bytes;
    for (size_t y = 0; y < size_t(image.height); ++y) {
        for (size_t x = 0; x < width; ++x) to_rgbe(pixels[y * width + x], &row[4 * x]);
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
    }
}

uint8_t srgb_code(float v) {
    return uint8_t(linear_to_srgb(std::clamp(v, 0.0f, 1.0f)) * 255 + 0.5f);
}

void write_srgb(OutputFile& file, const Image& image, ExrPrecision) {
    file.write(encode_png(image.width, image.height, srgb_codes(colours(file, image))));
}

struct Writer {
    const char* extension;
    void (*write)(OutputFile& file, const Image& image, ExrPrecision precision);
};
constexpr Writer kWriters[] = {
    {".exr", write_exr}, {".pfm", write_pfm}, {".hdr", write_hdr}, {".png", write_srgb}};

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

void write_image(const std::string& path, const Image& image, ExrPrecision precision, Links links) {
    const Writer& writer = writer_for(path);
    if (image.pixel_count() == 0 ||
        image.data.size() != image.pixel_count() * image.channels.size())
        fail_write(path, "the image is empty");
    OutputFile file(path, links);
    writer.write(file, image, precision);
    file.commit();
}

}  // namespace etendue
