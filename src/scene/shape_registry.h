#pragma once
// Shape plug-ins: their tables and makers.

#include <memory>
#include <vector>

#include "description/params.h"
#include "geometry/shape.h"

namespace etendue {

struct ShapeEntry {
    PluginInfo info;
    /// `warn` takes remarks on data that was mended.
    std::unique_ptr<Shape> (*make)(const Params& params,
                                   const std::function<void(const std::string&)>& warn);
};
/// All but `shapegroup` and `instance`, which the builder resolves itself; their tables are `group_info()`.
const std::vector<ShapeEntry>& shape_registry();
const std::vector<PluginInfo>& group_infos();

}  // namespace etendue
