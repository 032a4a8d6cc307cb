#include "texture/texture_cache.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "image/image_io.h"

namespace etendue {
namespace {

bool is_finite(float v) {
    return std::isfinite(v);
}
bool is_finite(Half v) {
    return v.isFinite();
}
bool is_negative(float v) {
    return v < 0;
}
bool is_negative(Half v) {
    return float(v) < 0;
}

/// Sets negative values to zero unless `raw`; returns the number of values that are not finite.
template <class T>
size_t sanitize(std::vector<T>& data, bool raw) {
    size_t bad = 0;
    for (T& v : data) {
        if (!is_finite(v)) ++bad;
        if (!raw && is_negative(v)) v = T{};
    }
    return bad;
}
size_t sanitize(std::vector<uint8_t>&, bool) {
    return 0;
}

}  // namespace

const PixelBuffer& TextureCache::load(const std::string& path, bool raw) {
    auto& image = images_[{std::filesystem::weakly_canonical(path).string(), raw}];
    if (!image) {
        auto loaded = std::make_unique<PixelBuffer>(read_pixels(path, raw));
        const size_t bad =
            std::visit([&](auto& data) { return sanitize(data, raw); }, loaded->data);
        if (bad > 0)
            throw std::runtime_error("image \"" + path + "\" has " + std::to_string(bad) +
                                     " values that are infinite or NaN");
        image = std::move(loaded);
    }
    return *image;
}

size_t TextureCache::memory_bytes() const {
    size_t sum = 0;
    for (const auto& [key, image] : images_)
        if (image) sum += image->memory_bytes();
    return sum;
}

}  // namespace etendue
