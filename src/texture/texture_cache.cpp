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
        if (const auto it = images_.find(key); it != images_.end()) return *it->second.image;
    }
    const bool is_file = !std::get<const EncodedImage*>(key);
    const FileState file = is_file ? file_state(name) : FileState{};
    if (const Entry* known = find_earlier(key, file)) {
        const std::lock_guard lock(mutex_);
        return *images_.try_emplace(key, *known).first->second.image;
    }
    PixelBuffer image = read();
    const bool raw = std::get<bool>(key);
    const size_t bad = std::visit([&](auto& data) { return sanitize(data, raw); }, image.data);
    if (bad > 0)
        throw std::runtime_error("image \"" + name + "\" has " + std::to_string(bad) +
                                 " values that are infinite or NaN");
    const std::lock_guard lock(mutex_);
    auto shared = std::make_shared<const PixelBuffer>(std::move(image));
    return *images_.try_emplace(key, Entry{std::move(shared), file}).first->second.image;
}

const TextureCache::Entry* TextureCache::find_earlier(const Key& key, const FileState& file) const {
    if (!earlier_) return nullptr;
    const auto it = earlier_->find(key);
    if (it == earlier_->end()) return nullptr;
    const bool is_embedded = std::get<const EncodedImage*>(key) != nullptr;
    return is_embedded || file.has_kept(it->second.file) ? &it->second : nullptr;
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
    for (const auto& [key, entry] : images_) sum += entry.image->memory_bytes();
    return sum;
}

}  // namespace etendue
