#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>

#include "description/scene_description.h"
#include "image/image.h"

namespace etendue {

/// The images of a scene's textures, each loaded once. Must outlive the textures made with it. Images can be loaded by
/// several threads.
class TextureCache {
public:
    /// Loads an image with read_pixels(). Negative values become zero unless `raw`. Throws std::runtime_error where the
    /// file cannot be read or a value is not finite.
    const PixelBuffer& load(const std::string& path, bool raw);
    /// The same for an image that the scene file holds itself, which is recognised by its address.
    const PixelBuffer& decode(const EncodedImage& image, bool raw);
    size_t memory_bytes() const;

private:
    /// The file, or the image of a scene file; whether it is raw.
    using Key = std::tuple<std::string, const EncodedImage*, bool>;
    /// What `read` returns the first time.
    template <class Read>
    const PixelBuffer& find_or_read(const Key& key, const std::string& name, const Read& read);

    std::mutex mutex_;
    std::map<Key, std::unique_ptr<const PixelBuffer>> images_;
};

}  // namespace etendue
