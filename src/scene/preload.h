#pragma once
// Reads the files of a scene's shapes and textures with all cores, before the scene is built in the order of its file.

#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "scene/built_parts.h"
#include "scene/shape_registry.h"
#include "system/available_memory.h"
#include "texture/texture_cache.h"

namespace etendue {

class Preload {
public:
    /// Makes all shapes of the description, and loads the images of its bitmaps. Errors are kept until the shape or
    /// bitmap is asked for. Shapes that are the same in `earlier`, which may be nullptr, are taken from there.
    Preload(const SceneDescription& description, TextureCache& images, const BuiltParts* earlier);

    /// The result, warnings and errors of `entry.make()` for an object. Each further time it is another shape.
    std::shared_ptr<const Shape> take_shape(const ShapeEntry& entry, const Params& params,
                                            const std::function<void(const std::string&)>& warn);
    /// All shapes that were taken, by object.
    std::vector<std::vector<BuiltShape>> take_all() { return std::move(taken_); }

private:
    struct Made {
        BuiltShape built;
        std::exception_ptr error;
    };
    /// The number of shapes of an object that can be taken from an earlier scene.
    size_t known_shapes(int index) const;
    Made make(const ShapeEntry& entry, const Params& params);

    std::mutex mutex_;
    MemoryWatch watch_;  ///< Over all shapes: many may name the same file.
    const SceneDescription& description_;
    const BuiltParts* earlier_;
    std::vector<std::optional<Made>> shapes_;  ///< By object.
    std::vector<std::vector<BuiltShape>> taken_;
};

}  // namespace etendue
