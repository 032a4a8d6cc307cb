#pragma once
// Reads the files of a scene's shapes and textures with all cores, before the scene is built in the order of its file.

#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "scene/shape_registry.h"
#include "system/available_memory.h"
#include "texture/texture_cache.h"

namespace etendue {

class Preload {
public:
    /// Makes all shapes of the description, and loads the images of its bitmaps. Errors are kept until the shape or
    /// bitmap is asked for.
    Preload(const SceneDescription& description, TextureCache& images);

    /// The result, warnings and errors of `entry.make()` for an object. A shape can be taken once; it is made again
    /// after that.
    std::unique_ptr<Shape> take_shape(const ShapeEntry& entry, const Params& params,
                                      const std::function<void(const std::string&)>& warn);

private:
    struct Made {
        std::unique_ptr<Shape> shape;
        std::vector<std::string> warnings;
        std::exception_ptr error;
    };
    Made make(const ShapeEntry& entry, const Params& params);

    std::mutex mutex_;
    MemoryWatch watch_;                        ///< Over all shapes: many may name the same file.
    std::vector<std::optional<Made>> shapes_;  ///< By object.
};

}  // namespace etendue
