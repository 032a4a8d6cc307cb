#include "image/image_contents.h"

#include <stdexcept>

#include <fmt/format.h>

#include "system/available_memory.h"

namespace etendue {
namespace {

std::vector<std::string> channel_names(int count) {
    switch (count) {
    case 1: return {"Y"};
    case 2: return {"Y", "A"};
    case 3: return {"R", "G", "B"};
    default: return {"R", "G", "B", "A"};
    }
}

template <class T>
ImageContents contents(int width, int height, int channels, std::vector<T> values) {
    ImageContents c;
    PixelBuffer& p = c.pixels;
    p.width = width, p.height = height, p.channels = channels;
    p.data = std::move(values);
    if (channels == 2 || channels == 4) p.alpha_channel = channels - 1;
    c.channels = channel_names(channels);
    return c;
}

}  // namespace

void fail_read(const std::string& path, const std::string& why) {
    throw std::runtime_error(fmt::format("cannot read \"{}\": {}", path, why));
}

void check_image_size(const ImageSource& source, uint64_t width, uint64_t height,
                      uint64_t pixel_bytes) {
    // No codec compresses better than this. A header with a larger size is damaged, and would exhaust the memory.
    constexpr uint64_t kBestRatio = 4096, kAlwaysFine = 256u << 20;
    constexpr uint64_t kLargestSide = 1 << 20;
    if (width < 1 || height < 1) fail_read(source.name, "it has no pixels");
    const uint64_t bytes = width * height * pixel_bytes;
    if (width > kLargestSide || height > kLargestSide || pixel_bytes > kLargestSide ||
        (bytes > kAlwaysFine && bytes / kBestRatio > source.bytes.size()))
        fail_read(source.name,
                  fmt::format("its header claims {} x {} pixels, too many for the file's size",
                              width, height));
    if (const auto free = available_memory(); free && bytes > *free)
        fail_read(source.name,
                  fmt::format("its {} x {} pixels need {} of memory, but only {} are free", width,
                              height, format_bytes(bytes), format_bytes(*free)));
}

ImageContents radiance_of(int width, int height, int channels, std::vector<float> values) {
    return contents(width, height, channels, std::move(values));
}

ImageContents coded(int width, int height, int channels, std::vector<uint8_t> codes) {
    ImageContents c = contents(width, height, channels, std::move(codes));
    c.is_linear = false;
    c.largest_code = 255;
    return c;
}

ImageContents deeply_coded(int width, int height, int channels, std::vector<float> values) {
    ImageContents c = contents(width, height, channels, std::move(values));
    c.is_linear = false;
    return c;
}

}  // namespace etendue
