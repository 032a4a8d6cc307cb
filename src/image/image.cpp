#include "image/image.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

namespace etendue {
namespace {

std::string_view layer_of(std::string_view channel) {
    const size_t dot = channel.rfind('.');
    return dot == std::string_view::npos ? std::string_view() : channel.substr(0, dot);
}

std::string channel_name(std::string_view layer, std::string_view name) {
    return layer.empty() ? std::string(name) : fmt::format("{}.{}", layer, name);
}

/// -1 if there is none.
int index_of(const std::vector<std::string>& channels, std::string_view name) {
    const auto it = std::find(channels.begin(), channels.end(), name);
    return it == channels.end() ? -1 : int(it - channels.begin());
}

}  // namespace

Image::Image(int width, int height, std::vector<std::string> names)
    : width(width), height(height), channels(std::move(names)),
      data(pixel_count() * channels.size()) {}

int Image::channel(std::string_view name) const {
    return index_of(channels, name);
}

std::vector<std::string> Image::layers() const {
    std::vector<std::string> found;
    for (const std::string& channel : channels)
        if (std::find(found.begin(), found.end(), layer_of(channel)) == found.end())
            found.emplace_back(layer_of(channel));
    return found;
}

RgbChannels rgb_channels(const std::vector<std::string>& channels, std::string_view layer) {
    const auto find = [&](std::string_view name) {
        return index_of(channels, channel_name(layer, name));
    };
    const RgbChannels rgb{{find("R"), find("G"), find("B")}};
    if (std::min({rgb.index[0], rgb.index[1], rgb.index[2]}) >= 0) return rgb;
    int grey = find("Y");
    const auto in_layer = [&](const std::string& c) { return layer_of(c) == layer; };
    if (grey < 0 && std::count_if(channels.begin(), channels.end(), in_layer) == 1)
        grey = int(std::find_if(channels.begin(), channels.end(), in_layer) - channels.begin());
    if (grey < 0)
        throw std::runtime_error(
            fmt::format("the image has no channels R, G, B{} (it has: {})",
                        layer.empty() ? "" : fmt::format(" in layer \"{}\"", layer),
                        fmt::join(channels, ", ")));
    return {{grey, grey, grey}};
}

std::vector<Rgb> rgb_pixels(const Image& image, std::string_view layer) {
    const RgbChannels rgb = rgb_channels(image.channels, layer);
    std::vector<Rgb> pixels(image.pixel_count());
    const float* p = image.data.data();
    for (Rgb& pixel : pixels) {
        pixel = rgb.of(p);
        p += image.channels.size();
    }
    return pixels;
}

ImageRows rows_of(const Image& image) {
    if (image.data.size() != image.pixel_count() * image.channels.size())
        throw std::invalid_argument("an image has another number of values than its size says");
    return {image.width, image.height, image.channels, image.attributes,
            [&image](int y, std::span<float> to) {
                std::copy_n(image.data.begin() + std::ptrdiff_t(size_t(y) * to.size()), to.size(),
                            to.begin());
            }};
}

Image to_image(const ImageRows& rows) {
    Image image(rows.width, rows.height, rows.channels);
    image.attributes = rows.attributes;
    const size_t size = size_t(rows.width) * rows.channels.size();
    for (int y = 0; y < rows.height; ++y)
        rows.make(y, std::span(image.data).subspan(size_t(y) * size, size));
    return image;
}

void add_rgb_channels(std::string_view layer, std::vector<std::string>& channels) {
    for (const char* name : {"R", "G", "B"}) channels.push_back(channel_name(layer, name));
}

void add_rgb_layer(Image& image, int width, int height, std::string_view layer,
                   std::span<const Rgb> pixels) {
    if (image.channels.empty()) image = Image(width, height, {});
    if (image.width != width || image.height != height || pixels.size() != image.pixel_count())
        throw std::invalid_argument(
            fmt::format("layer \"{}\" has another size than the image", layer));
    const size_t before = image.channels.size(), after = before + 3;
    std::vector<float> data(image.pixel_count() * after);
    for (size_t i = 0; i < pixels.size(); ++i) {
        float* to = std::copy_n(image.data.data() + i * before, before, data.data() + i * after);
        for (int c = 0; c < 3; ++c) to[c] = pixels[i][c];
    }
    image.data = std::move(data);
    add_rgb_channels(layer, image.channels);
}

Image layered_image(int width, int height, std::span<const RgbLayer> layers) {
    std::vector<std::string> channels;
    for (const RgbLayer& l : layers) add_rgb_channels(l.name, channels);
    Image image(width, height, std::move(channels));
    for (size_t l = 0; l < layers.size(); ++l) {
        if (layers[l].pixels.size() != image.pixel_count())
            throw std::invalid_argument(
                fmt::format("layer \"{}\" has another size than the image", layers[l].name));
        float* to = image.data.data() + 3 * l;
        for (const Rgb& c : layers[l].pixels) {
            for (int i = 0; i < 3; ++i) to[i] = c[i];
            to += image.channels.size();
        }
    }
    return image;
}

Image rgb_image(int width, int height, std::span<const Rgb> pixels) {
    return layered_image(width, height, std::array{RgbLayer{"", pixels}});
}

size_t PixelBuffer::memory_bytes() const {
    return std::visit([](const auto& v) { return v.capacity() * sizeof(v[0]); }, data);
}

}  // namespace etendue
