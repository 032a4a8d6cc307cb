#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "image/image.h"

namespace etendue {

/// The images of a scene's textures, each loaded once. Must outlive the textures made with it.
class TextureCache {
public:
    /// Loads an image with read_pixels(). Negative values become zero unless `raw`. Throws std::runtime_error where the
    /// file cannot be read or a value is not finite.
    const PixelBuffer& load(const std::string& path, bool raw);
    /// The same for the bytes of an image file, which is called `name`.
    const PixelBuffer& decode(const std::string& bytes, const std::string& name, bool raw);
    size_t memory_bytes() const;

private:
    const PixelBuffer& keep(PixelBuffer image, const std::string& name, bool raw);

    std::map<std::pair<std::string, bool>, std::unique_ptr<const PixelBuffer>> images_;
};

}  // namespace etendue
