#pragma once
// Shape plug-ins: their tables and factories.

#include <memory>
#include <vector>

#include "description/params.h"
#include "geometry/shape.h"

namespace etendue {

struct ShapeEntry {
    PluginInfo info;
    /// `warn` is called with a message where data was repaired.
    std::unique_ptr<Shape> (*make)(const Params& params,
                                   const std::function<void(const std::string&)>& warn);
};
/// All shape plug-ins except `shapegroup`, `instance` and `merge`, which the builder handles; their tables are group_infos().
const std::vector<ShapeEntry>& shape_registry();
const std::vector<PluginInfo>& group_infos();

}  // namespace etendue
