#include "session/scene_geometry.h"

#include <array>
#include <cmath>
#include <unordered_map>

#include "pathspace/vertex.h"

namespace etendue {
namespace {

struct Mesh {
    std::vector<Vec3> positions;
    std::vector<uint32_t> triangles;
};

/// All other shapes have parameters (u, v) in [0, 1]².
Mesh grid_of(const Shape& shape) {
    constexpr int kColumns = 48, kRows = 24;
    Mesh mesh;
    for (int row = 0; row <= kRows; ++row)
        for (int column = 0; column <= kColumns; ++column)
            mesh.positions.push_back(
                shape.surface(0, float(column) / kColumns, float(row) / kRows, false).p);
    for (int row = 0; row < kRows; ++row)
        for (int column = 0; column < kColumns; ++column) {
            const auto a = uint32_t(row * (kColumns + 1) + column), b = a + 1, c = a + kColumns + 1,
                       d = c + 1;
            mesh.triangles.insert(mesh.triangles.end(), {a, b, d, a, d, c});
        }
    return mesh;
}

Mesh mesh_of(const Shape& shape) {
    const auto* triangles = dynamic_cast<const TriangleMesh*>(&shape);
    if (!triangles) return grid_of(shape);
    Mesh mesh{triangles->positions, {}};
    for (const auto& t : triangles->triangles)
        mesh.triangles.insert(mesh.triangles.end(), t.begin(), t.end());
    return mesh;
}

/// Merges the vertices of each cell of a grid with this cell size, and drops triangles that collapse.
Mesh clustered(const Mesh& mesh, Vec3 origin, float cell) {
    Mesh out;
    std::unordered_map<uint64_t, uint32_t> cells;
    std::vector<uint32_t> merged(mesh.positions.size());
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3 at = (mesh.positions[i] - origin) * (1 / cell);
        uint64_t key = 0;
        for (int axis = 0; axis < 3; ++axis)
            key = key << 21 | (uint64_t(std::max(0.0f, at[axis])) & 0x1fffff);
        const auto [place, is_new] = cells.emplace(key, uint32_t(out.positions.size()));
        if (is_new) out.positions.push_back(mesh.positions[i]);
        merged[i] = place->second;
    }
    for (size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
        const uint32_t a = merged[mesh.triangles[i]], b = merged[mesh.triangles[i + 1]],
                       c = merged[mesh.triangles[i + 2]];
        if (a != b && b != c && c != a) out.triangles.insert(out.triangles.end(), {a, b, c});
    }
    return out;
}

void describe(const Scene& scene, DrawnShape& to) {
    const SceneShape& shape = scene.shapes()[to.shape];
    to.emits = shape.emitter != nullptr;
    SurfaceLocation at;
    at.shape = to.shape;
    at.u = at.v = 0.3f;
    const SurfaceGeometry g = scene.surface(at);
    ComponentArena arena;
    Vertex v;
    v.set_surface(shape, at, g, g.ng, arena);
    to.color = v.bsdf.albedo_estimate();
    to.is_specular = !v.is_connectible;
}

}  // namespace

std::vector<DrawnShape> drawn_shapes(const Scene& scene, size_t most_triangles) {
    std::vector<Mesh> meshes;
    size_t triangles = 0;
    for (const SceneShape& shape : scene.shapes()) {
        meshes.push_back(mesh_of(*shape.shape));
        triangles += meshes.back().triangles.size() / 3;
    }
    // Coarser from step to step.
    const float size = scene.bounds().is_empty() ? 1 : 2 * scene.bounds().radius();
    constexpr int kFinest = 1024, kCoarsest = 16;
    for (int cells = kFinest; triangles > most_triangles && cells >= kCoarsest; cells /= 2) {
        triangles = 0;
        for (Mesh& mesh : meshes) {
            constexpr size_t kSmall = 3 * 2400;
            if (mesh.triangles.size() > kSmall)
                mesh = clustered(mesh, scene.bounds().lo, size / float(cells));
            triangles += mesh.triangles.size() / 3;
        }
    }
    std::vector<DrawnShape> drawn;
    for (size_t i = 0; i < meshes.size(); ++i) {
        const Mesh& mesh = meshes[i];
        if (mesh.triangles.empty()) continue;
        DrawnShape& to = drawn.emplace_back();
        to.shape = uint32_t(i);
        to.name = scene.shapes()[i].name;
        describe(scene, to);
        for (const Vec3 p : mesh.positions) to.bounds.extend(p);
        for (const Vec3 p : mesh.positions)
            for (int axis = 0; axis < 3; ++axis) {
                const float extent = to.bounds.hi[axis] - to.bounds.lo[axis];
                const float at = extent > 0 ? (p[axis] - to.bounds.lo[axis]) / extent : 0.0f;
                to.positions.push_back(uint16_t(std::lround(at * 65535)));
            }
        to.triangles = mesh.triangles;
    }
    return drawn;
}

}  // namespace etendue
