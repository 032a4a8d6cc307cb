#pragma once
// Wavefront .obj meshes.

#include <string>
#include <string_view>

#include "description/mesh_data.h"

namespace etendue {

/// Reads all groups and objects of the file as one mesh. Polygons become triangle fans; corners with equal indices of
/// position, texture coordinate and normal become one vertex, in the order of first use. Materials, smoothing groups,
/// lines and points are ignored. Throws SceneError.
MeshData read_obj(const std::string& path, const MeshOptions& options = {});
MeshData parse_obj(std::string_view text, const std::string& name, const MeshOptions& options = {});

}  // namespace etendue
