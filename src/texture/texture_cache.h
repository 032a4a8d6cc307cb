#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>

#include "description/scene_description.h"
#include "image/image.h"
#include "system/file_state.h"

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

    /// The file, or the image of a scene file; whether it is raw.
    using Key = std::tuple<std::string, const EncodedImage*, bool>;
    struct Entry {
        std::shared_ptr<const PixelBuffer> image;
        FileState file;  ///< Before it was read.
    };
    using Images = std::map<Key, Entry>;
    /// All that are loaded.
    const Images& images() const { return images_; }
    /// Images of another cache, which are taken from there if their files have not changed. Those of scene files must still
    /// be at their addresses. They must outlive all calls of load() and decode().
    void use(const Images& earlier) { earlier_ = &earlier; }

private:
    /// What `read` returns the first time.
    template <class Read>
    const PixelBuffer& find_or_read(const Key& key, const std::string& name, const Read& read);

    /// As it was loaded earlier, if that is still what it is.
    const Entry* find_earlier(const Key& key, const FileState& file) const;

    const Images* earlier_ = nullptr;
    std::mutex mutex_;
    Images images_;
};

}  // namespace etendue
