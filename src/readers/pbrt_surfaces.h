#pragma once
// Surfaces that become meshes: patches, surfaces of revolution, subdivision surfaces.

#include <functional>

#include "description/mesh_data.h"

namespace etendue {

/// Bilinear patches of four corners each, at (0, 0), (1, 0), (0, 1) and (1, 1) of their (u, v): two triangles where a
/// patch is flat and has no normals, else 16 × 16 squares with the patch's normals.
MeshData bilinear_patches(const MeshData& vertices, const std::vector<uint32_t>& corners);

/// A surface about the z axis: a curve of points (r, z) turned by up to `phi_max`.
struct Revolution {
    struct Point {
        float r, z;    ///< On the curve.
        float nr, nz;  ///< Outward normal there, of any length.
    };
    std::function<Point(float v)> curve;  ///< v in [0, 1]
    float phi_max;
};
Revolution sphere_surface(float radius, float z_min, float z_max, float phi_max);
Revolution cylinder_surface(float radius, float z_min, float z_max, float phi_max);
Revolution disk_surface(float radius, float inner_radius, float height, float phi_max);
Revolution cone_surface(float radius, float height, float phi_max);
Revolution paraboloid_surface(float radius, float z_min, float z_max, float phi_max);
/// With (u, v) = (φ/phi_max, v) and the normals of the surface.
MeshData tessellate(const Revolution& surface);

/// Loop's subdivision [Loop 1987]: every triangle becomes four, `levels` times; the vertices end on the limit surface,
/// with the normals of the fine mesh.
MeshData loop_subdivide(MeshData mesh, int levels, const SourceLocation& where);

}  // namespace etendue
