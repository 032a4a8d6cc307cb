#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "image/image.h"

namespace etendue {

/// The images of a scene's textures, each loaded once. Must outlive the textures made with it. Images can be loaded by
/// several threads.
class TextureCache {
public:
    /// Loads an image with read_pixels(). Negative values become zero unless `raw`. Throws std::runtime_error where the
    /// file cannot be read or a value is not finite.
    const PixelBuffer& load(const std::string& path, bool raw);
    /// The same for the bytes of an image file, which is called `name`.
    const PixelBuffer& decode(const std::string& bytes, const std::string& name, bool raw);
    size_t memory_bytes() const;

private:
    /// The image `name`, which `read` returns the first time.
    template <class Read>
    const PixelBuffer& find_or_read(const std::string& name, bool raw, const Read& read);

    std::mutex mutex_;
    std::map<std::pair<std::string, bool>, std::unique_ptr<const PixelBuffer>> images_;
};

}  // namespace etendue
