#include "readers/pbrt_surfaces.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace etendue {
namespace {

/// The vertices and triangles of a grid of `nu` × `nv` squares; `vertex(u, v)` adds one vertex.
template <class AddVertex>
void add_grid(MeshData& mesh, uint32_t nu, uint32_t nv, const AddVertex& vertex) {
    const auto base = uint32_t(mesh.positions.size());
    for (uint32_t j = 0; j <= nv; ++j)
        for (uint32_t i = 0; i <= nu; ++i) vertex(float(i) / float(nu), float(j) / float(nv));
    for (uint32_t j = 0; j < nv; ++j)
        for (uint32_t i = 0; i < nu; ++i) {
            const uint32_t a = base + j * (nu + 1) + i, b = a + 1, c = a + nu + 1, d = c + 1;
            mesh.triangles.push_back({a, b, d});
            mesh.triangles.push_back({a, d, c});
        }
}

}  // namespace

MeshData bilinear_patches(const MeshData& vertices, const std::vector<uint32_t>& corners) {
    MeshData mesh;
    mesh.name = vertices.name;
    for (size_t first = 0; first + 3 < corners.size(); first += 4) {
        const auto interpolate = [&](const auto& values, float u, float v) {
            const auto at = [&](int i) { return values[corners[first + size_t(i)]]; };
            return (at(0) * (1 - u) + at(1) * u) * (1 - v) + (at(2) * (1 - u) + at(3) * u) * v;
        };
        const auto& p = vertices.positions;
        const Vec3 du0 = p[corners[first + 1]] - p[corners[first]],
                   du1 = p[corners[first + 3]] - p[corners[first + 2]];
        const Vec3 dv0 = p[corners[first + 2]] - p[corners[first]],
                   dv1 = p[corners[first + 3]] - p[corners[first + 1]];
        const Vec3 n0 = cross(du0, dv0);
        const float size = length(n0) * length(du1);
        const bool is_flat = std::fabs(dot(n0, du1)) <= 1e-5f * size;
        constexpr uint32_t kSquares = 16;
        // Triangles interpolate as patches do on parallelograms only.
        const bool is_parallelogram = length(du0 - du1) <= 1e-5f * length(du0);
        const bool has_attributes = !vertices.normals.empty() || !vertices.uvs.empty();
        const uint32_t squares = is_flat && (is_parallelogram || !has_attributes) ? 1 : kSquares;
        add_grid(mesh, squares, squares, [&](float u, float v) {
            mesh.positions.push_back(interpolate(p, u, v));
            mesh.uvs.push_back(vertices.uvs.empty() ? Vec2{u, v} : interpolate(vertices.uvs, u, v));
            const Vec3 dpdu = du0 * (1 - v) + du1 * v, dpdv = dv0 * (1 - u) + dv1 * u;
            mesh.normals.push_back(vertices.normals.empty() ? cross(dpdu, dpdv)
                                                            : interpolate(vertices.normals, u, v));
        });
    }
    return mesh;
}

Revolution sphere_surface(float radius, float z_min, float z_max, float phi_max) {
    const float lo = std::acos(clamp(z_min / radius, -1, 1)),
                hi = std::acos(clamp(z_max / radius, -1, 1));
    return {[=](float v) {
                const float theta = lerp(v, lo, hi), s = std::max(std::sin(theta), 0.0f),
                            c = std::cos(theta);
                return Revolution::Point{radius * s, radius * c, s, c};
            },
            phi_max};
}

Revolution cylinder_surface(float radius, float z_min, float z_max, float phi_max) {
    return {[=](float v) {
                return Revolution::Point{radius, lerp(v, z_min, z_max), 1, 0};
            },
            phi_max};
}

Revolution disk_surface(float radius, float inner_radius, float height, float phi_max) {
    return {[=](float v) {
                return Revolution::Point{lerp(v, radius, inner_radius), height, 0, 1};
            },
            phi_max};
}

Revolution cone_surface(float radius, float height, float phi_max) {
    return {[=](float v) {
                return Revolution::Point{radius * (1 - v), height * v, height, radius};
            },
            phi_max};
}

Revolution paraboloid_surface(float radius, float z_min, float z_max, float phi_max) {
    return {[=](float v) {
                const float z = lerp(v, z_min, z_max);
                const float r = radius * std::sqrt(z / z_max);
                // On r² = radius² z / z_max the outward normal is (2 r, −radius² / z_max).
                return Revolution::Point{r, z, 2 * r, -sqr(radius) / z_max};
            },
            phi_max};
}

MeshData tessellate(const Revolution& surface) {
    constexpr uint32_t kAround = 128, kAlong = 64;
    MeshData mesh;
    add_grid(mesh, kAround, kAlong, [&](float u, float v) {
        const Revolution::Point p = surface.curve(v);
        const float phi = u * surface.phi_max, c = std::cos(phi), s = std::sin(phi);
        mesh.positions.push_back({p.r * c, p.r * s, p.z});
        mesh.normals.push_back({p.nr * c, p.nr * s, p.nz});
        mesh.uvs.push_back({u, v});
    });
    return mesh;
}

namespace {

using Edge = std::pair<uint32_t, uint32_t>;
Edge edge(uint32_t a, uint32_t b) {
    return {std::min(a, b), std::max(a, b)};
}

/// The vertices around each vertex, and those along the border where it is on one.
struct Neighbours {
    std::vector<std::vector<uint32_t>> all;
    std::vector<std::vector<uint32_t>> border;
    std::map<Edge, std::vector<uint32_t>>
        opposite;  ///< Of each edge: the third corners of its triangles.

    explicit Neighbours(const MeshData& mesh)
        : all(mesh.positions.size()), border(mesh.positions.size()) {
        for (const auto& t : mesh.triangles)
            for (size_t i = 0; i < 3; ++i)
                opposite[edge(t[i], t[(i + 1) % 3])].push_back(t[(i + 2) % 3]);
        for (const auto& [e, corners] : opposite) {
            all[e.first].push_back(e.second);
            all[e.second].push_back(e.first);
            if (corners.size() != 2) {
                border[e.first].push_back(e.second);
                border[e.second].push_back(e.first);
            }
        }
    }
};

/// New place of a vertex: (1 − n w) of the old one and w of each neighbour, on a border of those along it.
Vec3 weighted(const MeshData& mesh, const Neighbours& near, uint32_t v, bool limit) {
    const Vec3 p = mesh.positions[v];
    const bool on_border = !near.border[v].empty();
    const std::vector<uint32_t>& ring = on_border ? near.border[v] : near.all[v];
    if (ring.empty() || (on_border && ring.size() != 2))
        return p;  // corners of several sheets stay
    const auto n = float(ring.size());
    float w;
    if (on_border) {
        w = limit ? 0.2f : 0.125f;
    } else {
        const float beta = ring.size() == 3 ? 3.0f / 16 : 3 / (8 * n);
        w = limit ? 1 / (n + 3 / (8 * beta)) : beta;
    }
    Vec3 sum = p * (1 - n * w);
    for (const uint32_t i : ring) sum += mesh.positions[i] * w;
    return sum;
}

MeshData subdivide_once(const MeshData& mesh) {
    const Neighbours near(mesh);
    MeshData out;
    out.name = mesh.name;
    for (uint32_t v = 0; v < mesh.positions.size(); ++v)
        out.positions.push_back(weighted(mesh, near, v, false));
    std::map<Edge, uint32_t> middle;
    for (const auto& [e, corners] : near.opposite) {
        middle[e] = uint32_t(out.positions.size());
        const Vec3 ends = mesh.positions[e.first] + mesh.positions[e.second];
        out.positions.push_back(
            corners.size() == 2
                ? ends * (3 / 8.0f) +
                      (mesh.positions[corners[0]] + mesh.positions[corners[1]]) * (1 / 8.0f)
                : ends * 0.5f);
    }
    for (const auto& t : mesh.triangles) {
        const uint32_t a = middle[edge(t[0], t[1])], b = middle[edge(t[1], t[2])],
                       c = middle[edge(t[2], t[0])];
        out.triangles.push_back({t[0], a, c});
        out.triangles.push_back({a, t[1], b});
        out.triangles.push_back({c, b, t[2]});
        out.triangles.push_back({a, b, c});
    }
    return out;
}

}  // namespace

MeshData loop_subdivide(MeshData mesh, int levels, const SourceLocation& where) {
    constexpr size_t kMostTriangles = size_t(1) << 28;
    if ((mesh.triangles.size() << (2 * levels)) > kMostTriangles)
        throw SceneError(where, "the subdivision would make more than 2^28 triangles");
    for (int i = 0; i < levels; ++i) mesh = subdivide_once(mesh);
    const Neighbours near(mesh);
    std::vector<Vec3> limit(mesh.positions.size());
    for (uint32_t v = 0; v < limit.size(); ++v) limit[v] = weighted(mesh, near, v, true);
    mesh.positions = std::move(limit);
    compute_vertex_normals(mesh);
    return mesh;
}

}  // namespace etendue
