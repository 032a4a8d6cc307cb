#pragma once
// What the builder keeps of a scene, so that the scene of an edited description is built from what has changed alone.

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "description/scene_description.h"
#include "geometry/accelerator.h"
#include "geometry/shape.h"
#include "math/transform.h"
#include "system/file_state.h"
#include "texture/texture_cache.h"

namespace etendue {

/// A shape as it was made, with the state of its file before that.
struct BuiltShape {
    std::shared_ptr<const Shape> shape;
    std::vector<std::string> warnings;
    std::optional<FileState> file;
};

/// Which shapes the accelerator has, and where.
struct AcceleratorLayout {
    std::vector<Accelerator::Member> top;
    std::vector<std::vector<Accelerator::Member>> groups;
    std::vector<std::pair<size_t, Transform>> instances;  ///< Of groups, by index.
    bool is_watertight = false;

    bool operator==(const AcceleratorLayout&) const = default;
};

class BuiltParts {
public:
    /// Keeps the meshes and images alive by whose addresses they are recognised.
    SceneDescription description;
    /// By object; several where several others refer to the object.
    std::vector<std::vector<BuiltShape>> shapes;
    TextureCache::Images images;
    AcceleratorLayout layout;
    std::optional<Accelerator> accelerator;
};

/// Whether the object `index` of both descriptions makes the same shape, as far as that does not depend on files: the numbers
/// of objects stay the same in edits.
bool is_same_shape(const SceneDescription& a, const SceneDescription& b, int index);

}  // namespace etendue
