#include "session/scene_geometry.h"

#include <algorithm>
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

/// Index of the vertex that stands for each vertex if all in a cell of a grid are merged.
std::vector<uint32_t> merged_vertices(const std::vector<Vec3>& positions, Vec3 origin, float cell) {
    std::unordered_map<uint64_t, uint32_t> cells;
    std::vector<uint32_t> merged(positions.size());
    for (size_t i = 0; i < positions.size(); ++i) {
        const Vec3 at = (positions[i] - origin) * (1 / cell);
        uint64_t key = 0;
        for (int axis = 0; axis < 3; ++axis)
            key = key << 21 | (uint64_t(std::max(0.0f, at[axis])) & 0x1fffff);
        merged[i] = cells.emplace(key, uint32_t(i)).first->second;
    }
    return merged;
}

/// The triangles of a mesh whose vertices are merged, without those that collapse.
std::vector<uint32_t> merged_triangles(const Mesh& mesh, Vec3 origin, float cell) {
    const std::vector<uint32_t> merged = merged_vertices(mesh.positions, origin, cell);
    std::vector<uint32_t> out;
    for (size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
        const uint32_t a = merged[mesh.triangles[i]], b = merged[mesh.triangles[i + 1]],
                       c = merged[mesh.triangles[i + 2]];
        if (a != b && b != c && c != a) out.insert(out.end(), {a, b, c});
    }
    return out;
}

/// The mesh with these of its triangles, and only the vertices that they use.
Mesh part_of(const Mesh& mesh, std::vector<uint32_t> triangles) {
    constexpr uint32_t kUnused = ~0u;
    Mesh out;
    std::vector<uint32_t> index(mesh.positions.size(), kUnused);
    for (uint32_t& vertex : triangles) {
        uint32_t& to = index[vertex];
        if (to == kUnused) {
            to = uint32_t(out.positions.size());
            out.positions.push_back(mesh.positions[vertex]);
        }
        vertex = to;
    }
    out.triangles = std::move(triangles);
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

DrawnShape::Place to_place(const Transform& to_world) {
    DrawnShape::Place place{};
    for (size_t row = 0; row < 3; ++row)
        for (size_t column = 0; column < 4; ++column)
            place[4 * row + column] = float(to_world.matrix()[row][column]);
    return place;
}

/// Places by shape. Shapes of groups have one for each instance; those before them are in world space.
struct Places {
    std::vector<std::vector<DrawnShape::Place>> of;
    size_t first_of_groups;
};
Places places_of(const Scene& scene) {
    const size_t shapes = scene.shapes().size();
    Places places{std::vector<std::vector<DrawnShape::Place>>(shapes), shapes};
    std::vector<uint32_t> instances(shapes), seen(shapes);
    const Accelerator& accelerator = scene.accelerator();
    const auto count = uint32_t(accelerator.instance_count());
    const auto for_each = [&](const auto& use) {
        for (uint32_t i = 0; i < count; ++i) {
            const auto [first, end] = accelerator.instance_shapes(i);
            for (uint32_t shape = first; shape < end; ++shape) use(i, shape);
        }
    };
    for_each([&](uint32_t, uint32_t shape) {
        ++instances[shape];
        places.first_of_groups = std::min(places.first_of_groups, size_t(shape));
    });
    for_each([&](uint32_t i, uint32_t shape) {
        // Every n-th, such that few enough are left.
        const size_t step = (instances[shape] + kMostPlaces - 1) / kMostPlaces;
        if (seen[shape]++ % step == 0)
            places.of[shape].push_back(to_place(accelerator.instance_transform(i)));
    });
    for (size_t shape = 0; shape < places.first_of_groups; ++shape)
        places.of[shape] = {to_place(Transform())};
    return places;
}

}  // namespace

std::vector<DrawnShape> drawn_shapes(const Scene& scene, size_t most_triangles) {
    const Places placed = places_of(scene);
    const auto& places = placed.of;
    struct Part {
        Mesh mesh;
        std::vector<uint32_t> coarse;  ///< Empty: the same as in the mesh.
        Bounds3 bounds;                ///< Of what cells are measured by.
        const std::vector<uint32_t>& coarsest() const {
            return coarse.empty() ? mesh.triangles : coarse;
        }
    };
    std::vector<Part> parts;
    for (const SceneShape& shape : scene.shapes()) {
        const bool is_in_world = parts.size() < placed.first_of_groups;
        parts.push_back(
            {mesh_of(*shape.shape), {}, is_in_world ? scene.bounds() : shape.shape->bounds()});
    }
    const auto has_too_many = [&](size_t most) {
        size_t triangles = 0, drawn = 0;
        for (size_t i = 0; i < parts.size(); ++i) {
            const size_t n = parts[i].coarsest().size() / 3;
            triangles += n;
            drawn += n * places[i].size();
        }
        return triangles > most || drawn > 4 * most;
    };
    // Coarser from step to step.
    constexpr int kFinest = 1024, kCoarsest = 16, kCoarseFraction = 16;
    constexpr size_t kSmall = 3 * 2400;
    const auto merge = [&](int cells, const auto& use) {
        for (Part& part : parts)
            if (part.mesh.triangles.size() > kSmall)
                use(part, merged_triangles(part.mesh, part.bounds.lo,
                                           2 * part.bounds.radius() / float(cells)));
    };
    int cells = kFinest;
    for (; has_too_many(most_triangles) && cells >= kCoarsest; cells /= 2)
        merge(cells, [](Part& part, std::vector<uint32_t> triangles) {
            part.mesh = part_of(part.mesh, std::move(triangles));
        });
    for (; has_too_many(most_triangles / kCoarseFraction) && cells >= kCoarsest; cells /= 2)
        merge(cells, [](Part& part, std::vector<uint32_t> triangles) {
            part.coarse = std::move(triangles);
        });
    std::vector<DrawnShape> drawn;
    for (size_t i = 0; i < parts.size(); ++i) {
        const Mesh& mesh = parts[i].mesh;
        if (mesh.triangles.empty() || places[i].empty()) continue;
        DrawnShape& to = drawn.emplace_back();
        to.shape = uint32_t(i);
        to.name = scene.shapes()[i].name;
        to.places = places[i];
        describe(scene, to);
        for (const Vec3 p : mesh.positions) to.bounds.extend(p);
        for (const Vec3 p : mesh.positions)
            for (int axis = 0; axis < 3; ++axis) {
                const float extent = to.bounds.hi[axis] - to.bounds.lo[axis];
                const float at = extent > 0 ? (p[axis] - to.bounds.lo[axis]) / extent : 0.0f;
                to.positions.push_back(uint16_t(std::lround(at * 65535)));
            }
        to.triangles = mesh.triangles;
        to.coarse_triangles = parts[i].coarse;
    }
    return drawn;
}

}  // namespace etendue
