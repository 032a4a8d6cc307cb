#pragma once
// Triangle meshes as the readers of mesh and scene files return them.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "description/source_location.h"
#include "math/vec.h"

namespace etendue {

struct MeshData {
    using Triangle = std::array<uint32_t, 3>;

    std::string name;  ///< Name within the file, if it has one; else the file's name.
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;  ///< Unit vectors, one per vertex, or empty.
    std::vector<Vec2> uvs;      ///< One per vertex, or empty.
    std::vector<Vec2>
        second_uvs;             ///< Another set of texture coordinates, one per vertex, or empty.
    std::vector<Vec3> colors;   ///< Linear colours, one per vertex, or empty.
    std::vector<float> alphas;  ///< Alpha of the colours, one per vertex, or empty.
    std::vector<Triangle> triangles;
    bool face_normals = false;        ///< The file asks for flat shading; normals is empty then.
    uint32_t dropped_degenerate = 0;  ///< Triangles of zero area, removed by finish_mesh().
    uint32_t replaced_normals = 0;    ///< Normals that were zero or not finite in the file.
    std::vector<std::string> notes;   ///< What the file has that is not used.
};

/// Calls use(name, array) for each array with a value for every vertex; such an array has to be listed here.
template <class Mesh, class Use>
void for_each_vertex_array(Mesh& mesh, const Use& use) {
    use("positions", mesh.positions);
    use("normals", mesh.normals);
    use("texture coordinates", mesh.uvs);
    use("second texture coordinates", mesh.second_uvs);
    use("colours", mesh.colors);
    use("alphas", mesh.alphas);
}

/// Memory of the arrays.
size_t memory_bytes(const MeshData& mesh);

/// How the numbers of a mesh file are interpreted. Mitsuba flips texture coordinates by default for .obj, but not for
/// .ply and .serialized.
struct MeshOptions {
    bool flip_tex_coords = false;  ///< v becomes 1 - v.
};

/// Last step of every mesh reader: checks the lengths of the arrays, that indices are in range and that positions and
/// texture coordinates are finite, removes triangles of zero area and vertices of no triangle, normalises normals (those
/// that are zero or not finite are computed from the faces), and applies the options. Throws SceneError where a check
/// fails or no triangle is left.
void finish_mesh(MeshData& mesh, const MeshOptions& options, const SourceLocation& where);

/// Replaces the normals by normalised sums of those of the adjacent faces, weighted by the angle at the vertex [Thürmer
/// & Wüthrich 1998]. Vertices of no triangle get +z.
void compute_vertex_normals(MeshData& mesh);

}  // namespace etendue
