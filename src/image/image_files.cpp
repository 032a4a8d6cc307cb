// The parts of image_io.h that need no library.

#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "color/srgb.h"
#include "image/image_codecs.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_write(const std::string& path, const std::string& why) {
    throw std::runtime_error(fmt::format("cannot write \"{}\": {}", path, why));
}

std::vector<Rgb> colours(const PendingFile& file, const Image& image) {
    try {
        return rgb_pixels(image);
    } catch (const std::runtime_error& e) {
        file.fail(e.what());
    }
}

// Portable float map: rows from the bottom, little-endian where the scale is negative.
void write_pfm(const PendingFile& file, const Image& image, ExrPrecision) {
    static_assert(std::endian::native == std::endian::little);
    const bool grey = image.channels.size() == 1;
    const std::vector<Rgb> pixels = colours(file, image);
    errno = 0;
    std::ofstream out(file.temporary(), std::ios::binary);
    out << fmt::format("{}\n{} {}\n-1.0\n", grey ? "Pf" : "PF", image.width, image.height);
    std::vector<float> row;
    for (int y = image.height - 1; y >= 0; --y) {
        row.clear();
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < (grey ? 1 : 3); ++c)
                row.push_back(pixels[size_t(y) * image.width + x][c]);
        out.write(reinterpret_cast<const char*>(row.data()),
                  std::streamsize(row.size() * sizeof(float)));
    }
    out.close();
    if (!out) file.fail(std::generic_category().message(errno));
}

void write_hdr(const PendingFile& file, const Image& image, ExrPrecision) {
    write_rgbe(file, image.width, image.height, colours(file, image));
}

uint8_t srgb_code(float v) {
    return uint8_t(linear_to_srgb(std::clamp(v, 0.0f, 1.0f)) * 255 + 0.5f);
}

void write_srgb(const PendingFile& file, const Image& image, ExrPrecision) {
    write_png(file, image.width, image.height, srgb_codes(colours(file, image)));
}

struct Writer {
    const char* extension;
    void (*write)(const PendingFile& file, const Image& image, ExrPrecision precision);
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

std::string image_extension(const std::string& path) {
    std::string e = fs::path(path).extension().string();
    std::transform(e.begin(), e.end(), e.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return e;
}

PixelBuffer decode_pixels(const std::string& bytes, const std::string& name, bool raw) {
    // The libraries select the format by the name of a file, so the bytes become one.
    const char* extension = bytes.rfind("\xff\xd8", 0) == 0 ? ".jpg" : ".png";
    std::string path = (fs::temp_directory_path() / "image-XXXXXX").string() + extension;
    const int handle = mkstemps(path.data(), 4);
    if (handle < 0)
        throw std::runtime_error(
            fmt::format("cannot write \"{}\": {}", path, std::generic_category().message(errno)));
    close(handle);
    const auto remove = [&] {
        std::error_code ignored;
        fs::remove(path, ignored);
    };
    try {
        std::ofstream out(path, std::ios::binary);
        out << bytes;
        out.close();
        if (!out) throw std::runtime_error(fmt::format("cannot write \"{}\"", path));
        PixelBuffer pixels = read_pixels(path, raw);
        remove();
        return pixels;
    } catch (const std::runtime_error& e) {
        remove();
        std::string why = e.what();
        if (const size_t at = why.find(path); at != why.npos) why.replace(at, path.size(), name);
        throw std::runtime_error(why);
    }
}

RgbImage read_rgb(const std::string& path, std::string_view layer) {
    const Image image = read_image(path);
    try {
        return {image.width, image.height, rgb_pixels(image, layer)};
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(fmt::format("cannot read \"{}\": {}", path, e.what()));
    }
}

void check_image_extension(const std::string& path) {
    writer_for(path);
}

void write_image(const std::string& path, const Image& image, ExrPrecision precision) {
    const Writer& writer = writer_for(path);
    if (image.pixel_count() == 0 ||
        image.data.size() != image.pixel_count() * image.channels.size())
        fail_write(path, "the image is empty");
    PendingFile file(path);
    writer.write(file, image, precision);
    file.commit();
}

}  // namespace etendue
