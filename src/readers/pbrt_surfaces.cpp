#include "readers/pbrt_surfaces.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>

#include <fmt/format.h>

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

/// A side of a triangle. Corner i of the triangle and the next one are its ends.
struct Side {
    uint32_t a, b;    ///< Ends; a < b, unless they are the same vertex.
    uint32_t corner;  ///< Three times the triangle, plus i.
};

/// The sides of all triangles, those of the same edge next to each other.
std::vector<Side> sorted_sides(const MeshData& mesh) {
    std::vector<Side> sides;
    sides.reserve(3 * mesh.triangles.size());
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
        for (uint32_t i = 0; i < 3; ++i) {
            const uint32_t a = mesh.triangles[t][i], b = mesh.triangles[t][(i + 1) % 3];
            sides.push_back({std::min(a, b), std::max(a, b), 3 * t + i});
        }
    std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
        return std::tie(x.a, x.b, x.corner) < std::tie(y.a, y.b, y.corner);
    });
    return sides;
}

/// Calls use(sides of an edge) for each edge.
template <class Use>
void for_each_edge(const std::vector<Side>& sides, const Use& use) {
    for (size_t begin = 0, end; begin < sides.size(); begin = end) {
        for (end = begin + 1; end < sides.size(); ++end)
            if (sides[end].a != sides[begin].a || sides[end].b != sides[begin].b) break;
        use(std::span(sides).subspan(begin, end - begin));
    }
}

/// The vertices around a vertex: their number and the sum of their positions.
struct Ring {
    uint32_t count = 0;
    Vec3 sum;

    void add(Vec3 p) {
        ++count;
        sum += p;
    }
};
struct Rings {
    Ring all;
    Ring border;  ///< Those along the border, where the vertex is on one.
};

std::vector<Rings> rings_of(const MeshData& mesh, const std::vector<Side>& sides) {
    std::vector<Rings> rings(mesh.positions.size());
    for_each_edge(sides, [&](std::span<const Side> edge) {
        const auto [a, b, corner] = edge.front();
        rings[a].all.add(mesh.positions[b]);
        rings[b].all.add(mesh.positions[a]);
        if (edge.size() == 2) return;
        rings[a].border.add(mesh.positions[b]);
        rings[b].border.add(mesh.positions[a]);
    });
    return rings;
}

/// New place of a vertex: (1 − n w) of the old one and w of each neighbour, on a border of those along it.
Vec3 weighted(Vec3 p, const Rings& rings, bool limit) {
    const bool on_border = rings.border.count > 0;
    const Ring& ring = on_border ? rings.border : rings.all;
    if (ring.count == 0 || (on_border && ring.count != 2))
        return p;  // corners of several sheets stay
    const auto n = float(ring.count);
    float w;
    if (on_border) {
        w = limit ? 0.2f : 0.125f;
    } else {
        const float beta = ring.count == 3 ? 3.0f / 16 : 3 / (8 * n);
        w = limit ? 1 / (n + 3 / (8 * beta)) : beta;
    }
    return p * (1 - n * w) + ring.sum * w;
}

MeshData subdivide_once(const MeshData& mesh) {
    const std::vector<Side> sides = sorted_sides(mesh);
    MeshData out;
    out.name = mesh.name;
    out.positions.reserve(mesh.positions.size() + sides.size() / 2);
    {
        const std::vector<Rings> rings = rings_of(mesh, sides);
        for (size_t v = 0; v < mesh.positions.size(); ++v)
            out.positions.push_back(weighted(mesh.positions[v], rings[v], false));
    }
    std::vector<uint32_t> middle(sides.size());  // By side; the new vertex upon it.
    const auto opposite = [&](const Side& s) {
        return mesh.positions[mesh.triangles[s.corner / 3][(s.corner % 3 + 2) % 3]];
    };
    for_each_edge(sides, [&](std::span<const Side> edge) {
        for (const Side& s : edge) middle[s.corner] = uint32_t(out.positions.size());
        const Vec3 ends = mesh.positions[edge[0].a] + mesh.positions[edge[0].b];
        out.positions.push_back(edge.size() == 2
                                    ? ends * (3 / 8.0f) +
                                          (opposite(edge[0]) + opposite(edge[1])) * (1 / 8.0f)
                                    : ends * 0.5f);
    });
    out.triangles.reserve(4 * mesh.triangles.size());
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
        const MeshData::Triangle& t = mesh.triangles[i];
        const uint32_t a = middle[3 * i], b = middle[3 * i + 1], c = middle[3 * i + 2];
        out.triangles.push_back({t[0], a, c});
        out.triangles.push_back({a, t[1], b});
        out.triangles.push_back({c, b, t[2]});
        out.triangles.push_back({a, b, c});
    }
    return out;
}

}  // namespace

MeshData loop_subdivide(MeshData mesh, int levels, const SourceLocation& where) {
    constexpr size_t kMostTriangles = size_t(1) << 24;
    if (mesh.triangles.size() > kMostTriangles >> (2 * levels))
        throw SceneError(where, fmt::format("{} subdivisions of {} triangles would make more than "
                                            "2^24: use fewer levels",
                                            levels, mesh.triangles.size()));
    for (int i = 0; i < levels; ++i) mesh = subdivide_once(mesh);
    const std::vector<Rings> rings = rings_of(mesh, sorted_sides(mesh));
    for (size_t v = 0; v < mesh.positions.size(); ++v)
        mesh.positions[v] = weighted(mesh.positions[v], rings[v], true);
    compute_vertex_normals(mesh);
    return mesh;
}

}  // namespace etendue
