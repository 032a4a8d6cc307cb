#pragma once
// Triangle meshes as the readers of mesh files return them.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "description/scene_description.h"
#include "math/vec.h"

namespace etendue {

struct MeshData {
    using Triangle = std::array<uint32_t, 3>;

    std::string name;  ///< Name within the file, if it has one; else the file's name.
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;  ///< Unit vectors, one per vertex, or empty.
    std::vector<Vec2> uvs;      ///< One per vertex, or empty.
    std::vector<Triangle> triangles;
    bool face_normals = false;        ///< The file asks for flat shading; normals is empty then.
    uint32_t dropped_degenerate = 0;  ///< Triangles without area, kept out by finish_mesh().
    uint32_t replaced_normals = 0;    ///< Normals that were zero or not finite in the file.
};

/// How a file's numbers are taken. Mitsuba's default is to flip for .obj, not to for .ply and
/// .serialized.
struct MeshOptions {
    bool flip_tex_coords = false;  ///< v becomes 1 - v.
};

/// What every reader ends with: applies the options, checks that indices are in range and that
/// positions and texture coordinates are finite, keeps out triangles without area, and makes
/// normals unit vectors (those that are zero or not finite are computed from the faces). Throws
/// SceneError where no triangle is left.
void finish_mesh(MeshData& mesh, const MeshOptions& options, const SourceLocation& where);

/// Replaces the normals by the sum of those of the adjacent faces, weighted by the angle at the
/// vertex [Thürmer & Wüthrich 1998]. Vertices of no triangle get +z.
void compute_vertex_normals(MeshData& mesh);

}  // namespace etendue
