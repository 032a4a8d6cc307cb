#pragma once
// Stanford .ply meshes: ascii and binary of either byte order.

#include <string>
#include <string_view>

#include "description/mesh_data.h"

namespace etendue {

/// Reads the elements "vertex" (x y z; nx ny nz; u v, s t, texture_u texture_v or texture_s texture_t) and "face" (a
/// list vertex_indices or vertex_index; polygons become triangle fans). Other elements and properties are ignored.
/// Throws SceneError.
MeshData read_ply(const std::string& path, const MeshOptions& options = {});
MeshData parse_ply(std::string_view bytes, const std::string& name,
                   const MeshOptions& options = {});

}  // namespace etendue
