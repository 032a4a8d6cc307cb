#include "session/scene_geometry.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

#include "pathspace/vertex.h"

namespace etendue {
namespace {

using Triangle = std::array<uint32_t, 3>;

struct Mesh {
    std::vector<Vec3> positions;
    std::vector<Triangle> triangles;
};

struct GridSize {
    int columns, rows;
    size_t triangles() const { return size_t(2) * size_t(columns) * size_t(rows); }
};

Mesh grid_of(const AnalyticShape& shape, GridSize size) {
    Mesh mesh;
    for (int row = 0; row <= size.rows; ++row)
        for (int column = 0; column <= size.columns; ++column) {
            const Vec2 at = shape.grid_parameters(
                {float(column) / float(size.columns), float(row) / float(size.rows)});
            mesh.positions.push_back(shape.surface(0, at.x, at.y, false).p);
        }
    for (int row = 0; row < size.rows; ++row)
        for (int column = 0; column < size.columns; ++column) {
            const auto a = uint32_t(row * (size.columns + 1) + column), b = a + 1,
                       c = a + uint32_t(size.columns) + 1, d = c + 1;
            mesh.triangles.insert(mesh.triangles.end(), {Triangle{a, b, d}, Triangle{a, d, c}});
        }
    return mesh;
}

/// A shape's triangles: those of its mesh, as long as they need not be simplified.
struct Part {
    const TriangleMesh* given = nullptr;
    Mesh own;
    std::vector<Triangle> coarse;  ///< Empty: the same as in the mesh.
    Bounds3 bounds;                ///< Of what cells are measured by.
    float size = 0;                ///< Of the shape, in world space for one place.

    size_t vertex_count() const { return given ? given->vertices().size() : own.positions.size(); }
    Vec3 position(size_t i) const { return given ? given->vertices()[i].p : own.positions[i]; }
    size_t triangle_count() const { return given ? given->faces().size() : own.triangles.size(); }
    const Triangle& triangle(size_t i) const {
        return given ? given->faces()[i].vertices : own.triangles[i];
    }
    size_t coarsest_count() const { return coarse.empty() ? triangle_count() : coarse.size(); }
    void replace(Mesh mesh) {
        given = nullptr;
        own = std::move(mesh);
    }
};

/// Index of the vertex that stands for each vertex if all in a cell of a grid are merged.
std::vector<uint32_t> merged_vertices(const Part& part, Vec3 origin, float cell) {
    std::unordered_map<uint64_t, uint32_t> cells;
    std::vector<uint32_t> merged(part.vertex_count());
    for (size_t i = 0; i < merged.size(); ++i) {
        const Vec3 at = (part.position(i) - origin) * (1 / cell);
        uint64_t key = 0;
        for (int axis = 0; axis < 3; ++axis)
            key = key << 21 | (uint64_t(std::max(0.0f, at[axis])) & 0x1fffff);
        merged[i] = cells.emplace(key, uint32_t(i)).first->second;
    }
    return merged;
}

/// The triangles of a mesh whose vertices are merged, without those that collapse.
std::vector<Triangle> merged_triangles(const Part& part, int cells) {
    const std::vector<uint32_t> merged =
        merged_vertices(part, part.bounds.lo, 2 * part.bounds.radius() / float(cells));
    std::vector<Triangle> out;
    for (size_t i = 0; i < part.triangle_count(); ++i) {
        const Triangle& t = part.triangle(i);
        const uint32_t a = merged[t[0]], b = merged[t[1]], c = merged[t[2]];
        if (a != b && b != c && c != a) out.push_back({a, b, c});
    }
    return out;
}

/// The mesh with these of its triangles, and only the vertices that they use.
Mesh mesh_of(const Part& part, std::vector<Triangle> triangles) {
    constexpr uint32_t kUnused = ~0u;
    Mesh out;
    std::vector<uint32_t> index(part.vertex_count(), kUnused);
    for (Triangle& t : triangles)
        for (uint32_t& vertex : t) {
            uint32_t& to = index[vertex];
            if (to == kUnused) {
                to = uint32_t(out.positions.size());
                out.positions.push_back(part.position(vertex));
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
            const auto [first, end] = accelerator.instance(i).shapes;
            for (uint32_t shape = first; shape < end; ++shape) use(i, shape);
        }
    };
    size_t all = 0;
    for_each([&](uint32_t, uint32_t shape) {
        ++all;
        ++instances[shape];
        places.first_of_groups = std::min(places.first_of_groups, size_t(shape));
    });
    for_each([&](uint32_t i, uint32_t shape) {
        // Every n-th, such that few enough are left.
        const size_t step = std::max((instances[shape] + kMostPlaces - 1) / kMostPlaces,
                                     (all + kMostPlacesInAll - 1) / kMostPlacesInAll);
        if (seen[shape]++ % step == 0)
            places.of[shape].push_back(to_place(accelerator.instance(i).to_world));
    });
    for (size_t shape = 0; shape < places.first_of_groups; ++shape)
        places.of[shape] = {to_place(Transform())};
    return places;
}

}  // namespace

std::vector<DrawnShape> drawn_shapes(const Scene& scene, size_t most_triangles) {
    const Places placed = places_of(scene);
    const auto& places = placed.of;
    std::vector<Part> parts(scene.shapes().size());
    size_t curved = 0;
    for (size_t i = 0; i < parts.size(); ++i) {
        const Shape& shape = *scene.shapes()[i].shape;
        parts[i].given = dynamic_cast<const TriangleMesh*>(&shape);
        parts[i].bounds = i < placed.first_of_groups ? scene.bounds() : shape.bounds();
        parts[i].size = shape.bounds().radius();
        curved += parts[i].given ? 0 : 1;
    }
    // Half of the triangles are for spheres and the like, so many that they are round where there are few of them.
    GridSize grid{48, 24};
    constexpr int kFewestRows = 4;
    while (grid.rows > kFewestRows && curved * grid.triangles() > most_triangles / 2)
        grid = {grid.columns / 2, grid.rows / 2};
    for (size_t i = 0; i < parts.size(); ++i)
        if (!parts[i].given && !places[i].empty())
            parts[i].own =
                grid_of(dynamic_cast<const AnalyticShape&>(*scene.shapes()[i].shape), grid);

    const auto has_too_many = [&](size_t most) {
        size_t triangles = 0, drawn = 0;
        for (size_t i = 0; i < parts.size(); ++i) {
            const size_t n = parts[i].coarsest_count();
            triangles += n;
            drawn += n * places[i].size();
        }
        return triangles > most || drawn > 4 * most;
    };
    // Coarser from step to step; small meshes only where that is not enough.
    constexpr int kFinest = 1024, kCoarsest = 16, kCoarseFraction = 16;
    constexpr size_t kSmall = 2400, kSmallest = 12;
    const auto merge = [&](size_t larger_than, int cells, const auto& use) {
        for (Part& part : parts)
            if (part.triangle_count() > larger_than) use(part, merged_triangles(part, cells));
    };
    const auto simplify = [](Part& part, std::vector<Triangle> triangles) {
        part.replace(mesh_of(part, std::move(triangles)));
    };
    int cells = kFinest;
    for (; has_too_many(most_triangles) && cells >= kCoarsest; cells /= 2)
        merge(kSmall, cells, simplify);
    for (const int coarse : {256, 64, kCoarsest})
        if (has_too_many(most_triangles)) merge(kSmallest, coarse, simplify);
    // What is still too much is left out, from the smallest shape on.
    std::vector<size_t> by_size(parts.size());
    std::iota(by_size.begin(), by_size.end(), size_t(0));
    std::stable_sort(by_size.begin(), by_size.end(),
                     [&](size_t a, size_t b) { return parts[a].size > parts[b].size; });
    size_t triangles = 0, drawn_triangles = 0;
    for (const size_t i : by_size) {
        const size_t n = parts[i].coarsest_count();
        if (triangles + n > most_triangles ||
            drawn_triangles + n * places[i].size() > 4 * most_triangles) {
            parts[i].replace({});
            continue;
        }
        triangles += n;
        drawn_triangles += n * places[i].size();
    }
    for (; has_too_many(most_triangles / kCoarseFraction) && cells >= kCoarsest; cells /= 2)
        merge(kSmall, cells,
              [](Part& part, std::vector<Triangle> coarse) { part.coarse = std::move(coarse); });

    const auto append = [](std::vector<uint32_t>& to, const Triangle& t) {
        to.insert(to.end(), t.begin(), t.end());
    };
    std::vector<DrawnShape> drawn;
    for (size_t i = 0; i < parts.size(); ++i) {
        const Part& part = parts[i];
        if (part.triangle_count() == 0 || places[i].empty()) continue;
        DrawnShape& to = drawn.emplace_back();
        to.shape = uint32_t(i);
        to.name = scene.shapes()[i].name;
        to.places = places[i];
        describe(scene, to);
        for (size_t k = 0; k < part.vertex_count(); ++k) to.bounds.extend(part.position(k));
        to.positions.reserve(3 * part.vertex_count());
        for (size_t k = 0; k < part.vertex_count(); ++k)
            for (int axis = 0; axis < 3; ++axis) {
                const Vec3 p = part.position(k);
                const float extent = to.bounds.hi[axis] - to.bounds.lo[axis];
                const float at = extent > 0 ? (p[axis] - to.bounds.lo[axis]) / extent : 0.0f;
                to.positions.push_back(uint16_t(std::lround(at * 65535)));
            }
        to.triangles.reserve(3 * part.triangle_count());
        for (size_t k = 0; k < part.triangle_count(); ++k) append(to.triangles, part.triangle(k));
        for (const Triangle& t : part.coarse) append(to.coarse_triangles, t);
    }
    return drawn;
}

}  // namespace etendue
