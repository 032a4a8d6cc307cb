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

}  // namespace

Image::Image(int width, int height, std::vector<std::string> names)
    : width(width), height(height), channels(std::move(names)),
      data(pixel_count() * channels.size()) {}

int Image::channel(std::string_view name) const {
    const auto it = std::find(channels.begin(), channels.end(), name);
    return it == channels.end() ? -1 : int(it - channels.begin());
}

std::vector<std::string> Image::layers() const {
    std::vector<std::string> found;
    for (const std::string& channel : channels)
        if (std::find(found.begin(), found.end(), layer_of(channel)) == found.end())
            found.emplace_back(layer_of(channel));
    return found;
}

std::vector<Rgb> rgb_pixels(const Image& image, std::string_view layer) {
    int rgb[3];
    for (int i = 0; i < 3; ++i)
        rgb[i] = image.channel(channel_name(layer, std::string_view("RGB").substr(i, 1)));
    if (rgb[0] < 0 || rgb[1] < 0 || rgb[2] < 0) {
        int grey = image.channel(channel_name(layer, "Y"));
        if (grey < 0) {
            const auto in_layer = [&](const std::string& c) { return layer_of(c) == layer; };
            if (std::count_if(image.channels.begin(), image.channels.end(), in_layer) == 1)
                grey = int(std::find_if(image.channels.begin(), image.channels.end(), in_layer) -
                           image.channels.begin());
        }
        if (grey < 0)
            throw std::runtime_error(
                fmt::format("the image has no channels R, G, B{} (it has: {})",
                            layer.empty() ? "" : fmt::format(" in layer \"{}\"", layer),
                            fmt::join(image.channels, ", ")));
        std::fill(rgb, rgb + 3, grey);
    }
    std::vector<Rgb> pixels(image.pixel_count());
    const float* p = image.data.data();
    for (Rgb& pixel : pixels) {
        pixel = {p[rgb[0]], p[rgb[1]], p[rgb[2]]};
        p += image.channels.size();
    }
    return pixels;
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
    for (const char* name : {"R", "G", "B"}) image.channels.push_back(channel_name(layer, name));
}

Image layered_image(int width, int height, std::span<const RgbLayer> layers) {
    std::vector<std::string> channels;
    for (const RgbLayer& l : layers)
        for (const char* name : {"R", "G", "B"}) channels.push_back(channel_name(l.name, name));
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
