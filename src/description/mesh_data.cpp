#include "description/mesh_data.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>

#include "math/triangle.h"

namespace etendue {
namespace {

EdgeProduct edge_product(const MeshData& mesh, const MeshData::Triangle& t) {
    return {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
}

/// Unit normal of a triangle, or empty where its area is zero.
std::optional<Vec3> face_normal(const MeshData& mesh, const MeshData::Triangle& t) {
    const EdgeProduct p = edge_product(mesh, t);
    if (!p.has_area()) return {};
    return p.normal();
}

/// Unit vector from a to b.
Vec3 direction(Vec3 a, Vec3 b) {
    const double x = double(b.x) - a.x, y = double(b.y) - a.y, z = double(b.z) - a.z;
    const double scale = 1 / std::sqrt(x * x + y * y + z * z);
    return {float(x * scale), float(y * scale), float(z * scale)};
}

void check_sizes(const MeshData& mesh, const SourceLocation& where) {
    for_each_vertex_array(mesh, [&](const std::string& name, const auto& values) {
        if (!values.empty() && values.size() != mesh.positions.size())
            throw SceneError(where, "the mesh has " + std::to_string(values.size()) + " " + name +
                                        " for " + std::to_string(mesh.positions.size()) +
                                        " vertices");
    });
}

void check_vertices(const MeshData& mesh, const SourceLocation& where) {
    for (size_t i = 0; i < mesh.positions.size(); ++i)
        if (!is_finite(mesh.positions[i]))
            throw SceneError(where, "position of vertex " + std::to_string(i) + " is not finite");
    for (const auto* uvs : {&mesh.uvs, &mesh.second_uvs})
        for (size_t i = 0; i < uvs->size(); ++i)
            if (!std::isfinite((*uvs)[i].x) || !std::isfinite((*uvs)[i].y))
                throw SceneError(where, "texture coordinate of vertex " + std::to_string(i) +
                                            " is not finite");
    for (size_t i = 0; i < mesh.colors.size(); ++i)
        if (!is_finite(mesh.colors[i]))
            throw SceneError(where, "colour of vertex " + std::to_string(i) + " is not finite");
    for (size_t i = 0; i < mesh.alphas.size(); ++i)
        if (!std::isfinite(mesh.alphas[i]))
            throw SceneError(where, "alpha of vertex " + std::to_string(i) + " is not finite");
}

void check_indices(const MeshData& mesh, const SourceLocation& where) {
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
        for (const uint32_t v : mesh.triangles[i])
            if (v >= mesh.positions.size())
                throw SceneError(where, "triangle " + std::to_string(i) + " refers to vertex " +
                                            std::to_string(v) + ", but there are only " +
                                            std::to_string(mesh.positions.size()));
}

void drop_degenerate(MeshData& mesh) {
    mesh.dropped_degenerate += uint32_t(std::erase_if(
        mesh.triangles, [&](const auto& t) { return !edge_product(mesh, t).has_area(); }));
}

/// Removes the vertices of no triangle; the others keep their order.
void drop_unused(MeshData& mesh) {
    std::vector<bool> is_used(mesh.positions.size());
    for (const MeshData::Triangle& t : mesh.triangles)
        for (const uint32_t v : t) is_used[v] = true;
    const auto used = size_t(std::count(is_used.begin(), is_used.end(), true));
    if (used == is_used.size()) return;
    std::vector<uint32_t> place(is_used.size());
    uint32_t next = 0;
    for (size_t i = 0; i < is_used.size(); ++i)
        if (is_used[i]) place[i] = next++;
    for_each_vertex_array(mesh, [&](const char*, auto& values) {
        if (values.empty()) return;
        std::remove_reference_t<decltype(values)> kept;
        kept.reserve(used);
        for (size_t i = 0; i < values.size(); ++i)
            if (is_used[i]) kept.push_back(values[i]);
        values = std::move(kept);
    });
    for (MeshData::Triangle& t : mesh.triangles)
        for (uint32_t& v : t) v = place[v];
}

void repair_normals(MeshData& mesh) {
    std::vector<uint32_t> missing;
    for (uint32_t i = 0; i < mesh.normals.size(); ++i) {
        const float length2 = etendue::length2(mesh.normals[i]);
        if (length2 > 0 && std::isfinite(length2))
            mesh.normals[i] = mesh.normals[i] / std::sqrt(length2);
        else
            missing.push_back(i);
    }
    if (missing.empty()) return;
    std::vector<Vec3> given = std::move(mesh.normals);
    compute_vertex_normals(mesh);
    for (const uint32_t i : missing) given[i] = mesh.normals[i];
    mesh.normals = std::move(given);
    mesh.replaced_normals += uint32_t(missing.size());
}

}  // namespace

size_t memory_bytes(const MeshData& mesh) {
    size_t bytes = mesh.triangles.size() * sizeof(MeshData::Triangle);
    for_each_vertex_array(
        mesh, [&](const char*, const auto& values) { bytes += values.size() * sizeof(values[0]); });
    return bytes;
}

void compute_vertex_normals(MeshData& mesh) {
    mesh.normals.assign(mesh.positions.size(), Vec3{});
    for (const MeshData::Triangle& t : mesh.triangles) {
        const std::optional<Vec3> n = face_normal(mesh, t);
        if (!n) continue;
        for (int i = 0; i < 3; ++i) {
            const Vec3 corner = mesh.positions[t[i]];
            const Vec3 a = direction(corner, mesh.positions[t[(i + 1) % 3]]);
            const Vec3 b = direction(corner, mesh.positions[t[(i + 2) % 3]]);
            // The angle between unit vectors, accurate near 0 and π [Kahan 2006, §12].
            mesh.normals[t[i]] += *n * (2 * std::atan2(length(a - b), length(a + b)));
        }
    }
    // Where the normals of the faces cancel, the vertex takes that of one face.
    constexpr float kCancelled2 = 1e-12f;
    for (const MeshData::Triangle& t : mesh.triangles)
        for (const uint32_t v : t)
            if (length2(mesh.normals[v]) <= kCancelled2)
                mesh.normals[v] = face_normal(mesh, t).value_or(Vec3{});
    for (Vec3& n : mesh.normals) n = length2(n) > 0 ? normalize(n) : Vec3{0, 0, 1};
}

void finish_mesh(MeshData& mesh, const MeshOptions& options, const SourceLocation& where) {
    check_sizes(mesh, where);
    check_vertices(mesh, where);
    check_indices(mesh, where);
    drop_degenerate(mesh);
    if (mesh.triangles.empty())
        throw SceneError(where, mesh.dropped_degenerate ? "all triangles of the mesh have zero area"
                                                        : "the mesh has no triangles");
    drop_unused(mesh);
    if (mesh.face_normals) mesh.normals.clear();
    repair_normals(mesh);
    if (options.flip_tex_coords)
        for (auto* uvs : {&mesh.uvs, &mesh.second_uvs})
            for (Vec2& uv : *uvs) uv.y = 1 - uv.y;
}

}  // namespace etendue
