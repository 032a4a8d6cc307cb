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

template <class Read>
const PixelBuffer& TextureCache::find_or_read(const Key& key, const std::string& name,
                                              const Read& read) {
    {
        const std::lock_guard lock(mutex_);
        if (const auto it = images_.find(key); it != images_.end()) return *it->second;
    }
    PixelBuffer image = read();
    const bool raw = std::get<bool>(key);
    const size_t bad = std::visit([&](auto& data) { return sanitize(data, raw); }, image.data);
    if (bad > 0)
        throw std::runtime_error("image \"" + name + "\" has " + std::to_string(bad) +
                                 " values that are infinite or NaN");
    const std::lock_guard lock(mutex_);
    return *images_.try_emplace(key, std::make_unique<PixelBuffer>(std::move(image))).first->second;
}

const PixelBuffer& TextureCache::load(const std::string& path, bool raw) {
    const std::string file = std::filesystem::weakly_canonical(path).string();
    return find_or_read({file, nullptr, raw}, file, [&] { return read_pixels(path, raw); });
}

const PixelBuffer& TextureCache::decode(const EncodedImage& image, bool raw) {
    return find_or_read({"", &image, raw}, image.name,
                        [&] { return decode_pixels(image.bytes, image.name, raw); });
}

size_t TextureCache::memory_bytes() const {
    size_t sum = 0;
    for (const auto& [key, image] : images_)
        if (image) sum += image->memory_bytes();
    return sum;
}

}  // namespace etendue
