#pragma once
// Mitsuba 0.6 .serialized meshes.

#include <string>
#include <string_view>

#include "description/mesh_data.h"

namespace etendue {

/// Reads mesh number `shape_index` of the file, counted from 0. Each mesh is a 16-bit identifier 0x041C, a 16-bit
/// version (3 or 4) and a deflated stream of: 32-bit flags; a zero-terminated name (version 4); the 64-bit numbers of
/// vertices and triangles; positions, normals, texture coordinates and colours, in single or double precision; 32-bit
/// indices. The file ends with the offset of each mesh (64 bits; 32 in version 3) and the 32-bit number of meshes. All
/// numbers are little-endian. Colours are ignored. Throws SceneError.
MeshData read_serialized(const std::string& path, int shape_index, const MeshOptions& options = {});
MeshData parse_serialized(std::string_view bytes, const std::string& name, int shape_index,
                          const MeshOptions& options = {});

}  // namespace etendue
