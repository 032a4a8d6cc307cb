#include "scene/shape_registry.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "description/mesh_data.h"
#include "description/resolve_file.h"
#include "math/frame.h"
#include "readers/file_bytes.h"
#include "readers/obj.h"
#include "readers/ply.h"
#include "readers/serialized.h"

namespace etendue {
namespace {

using Warn = std::function<void(const std::string&)>;

std::vector<ParamInfo> with_common(std::vector<ParamInfo> params) {
    params.push_back({"to_world", ParamKind::Transform, "identity", "Object-to-world transform."});
    params.push_back({"flip_normals", ParamKind::Bool, "false",
                      "Reverses the normals, so that the shape is turned inside out."});
    params.push_back({"bsdf", ParamKind::Object, "diffuse",
                      "Material; without one, a shape that emits is black."});
    params.push_back({"emitter", ParamKind::Object, "", "An area emitter."});
    params.push_back({"interior", ParamKind::Object, "", "Medium behind the surface."});
    params.push_back({"exterior", ParamKind::Object, "", "Medium in front of the surface."});
    return params;
}

// What formats need whose meshes without vertex normals are flat.
constexpr ParamInfo kComputeNormals = {
    "compute_normals", ParamKind::Bool, "true",
    "Whether a mesh without vertex normals gets smooth ones. If false, it is flat, and a "
    "mirroring to_world does not reverse its faces."};
constexpr ParamInfo kFlipFlatNormals = {"flip_flat_normals", ParamKind::Bool, "false",
                                        "Reverses the normals of a flat mesh."};

std::vector<ParamInfo> mesh_params(const char* flip) {
    return with_common(
        {{"filename", ParamKind::String, "", "Mesh file."},
         {"face_normals", ParamKind::Bool, "false", "Flat shading: vertex normals are ignored."},
         kComputeNormals,
         kFlipFlatNormals,
         {"flip_tex_coords", ParamKind::Bool, flip, "Replaces v by 1 - v."},
         {"collapse", ParamKind::Bool, "false", "Accepted; a file is always a single shape."},
         {"shape_index", ParamKind::Int, "0", "Index of the mesh in a .serialized file."},
         {"max_smooth_angle", ParamKind::Float, "", "Accepted; without effect."},
         {"srgb", ParamKind::Bool, "false", "Accepted; vertex colours are linear."}});
}

/// Converts the data of a mesh file to a mesh in world space.
std::unique_ptr<Shape> finish(MeshData data, const Params& params, const Warn& warn) {
    const std::string name = params.text("filename", data.name.empty() ? "mesh" : data.name);
    for (const std::string& note : data.notes) warn(fmt::format("{}: {}", name, note));
    const Transform t = params.transform("to_world");
    const bool compute_normals = params.flag("compute_normals", true);
    bool flat = params.flag("face_normals", false) || data.face_normals;
    bool flip = params.flag("flip_normals", false);
    if (data.normals.empty() && !flat && compute_normals) compute_vertex_normals(data);
    if (flat) data.normals.clear();
    flat = data.normals.empty();
    if (flat && !compute_normals && t.determinant3() < 0) flip = !flip;
    if (flat && params.flag("flip_flat_normals", false)) flip = !flip;
    if (!t.is_identity()) {
        for (Vec3& p : data.positions) p = t.point(p);
        for (Vec3& n : data.normals) n = normalize(t.normal(n));
    }
    if (flip) {
        for (Vec3& n : data.normals) n = -n;
        if (flat)
            for (auto& tri : data.triangles) std::swap(tri[1], tri[2]);
    }
    for (Vec3 p : data.positions)
        if (!is_finite(p))
            params.fail(
                "to_world",
                "\"to_world\" moves a vertex of the mesh out of the range of single precision");
    const size_t given = data.triangles.size() + data.dropped_degenerate;
    auto mesh = std::make_unique<TriangleMesh>(TriangleMesh::Arrays{
        std::move(data.positions), std::move(data.normals), std::move(data.uvs),
        std::move(data.second_uvs), std::move(data.colors), std::move(data.alphas),
        std::move(data.triangles)});
    if (mesh->faces().empty())
        params.fail("to_world", "\"to_world\" gives all triangles of the mesh zero area");
    if (const size_t dropped = given - mesh->faces().size())
        warn(fmt::format("{}: {} triangle{} of zero area left out", name, dropped,
                         dropped == 1 ? "" : "s"));
    if (!flat && data.replaced_normals > 0)
        warn(
            fmt::format("{}: {} normal{} that {} zero or not finite {} computed from the triangles",
                        name, data.replaced_normals, data.replaced_normals == 1 ? "" : "s",
                        data.replaced_normals == 1 ? "was" : "were",
                        data.replaced_normals == 1 ? "is" : "are"));
    return mesh;
}

/// What `read` makes of the file that a shape names.
template <class Read>
MeshData read_mesh(const Params& params, const Read& read) {
    const std::string file = resolve_file(params);
    try {
        return read(file);
    } catch (const UnreadableFile& e) {
        params.fail("filename", e.what());
    }
}

template <MeshData (*read)(const std::string&, const MeshOptions&)>
std::unique_ptr<Shape> make_file_mesh(const Params& params, const Warn& warn,
                                      bool flip_by_default) {
    const MeshOptions options{.flip_tex_coords = params.flag("flip_tex_coords", flip_by_default)};
    return finish(read_mesh(params, [&](const std::string& f) { return read(f, options); }), params,
                  warn);
}

std::unique_ptr<Shape> make_own_mesh(const Params& params, const Warn& warn) {
    const auto count = int64_t(params.scene().meshes.size());
    if (!params.has("mesh") || count == 0)
        params.fail("shape \"mesh\" needs a mesh, which only some formats can hold");
    return finish(params.scene().meshes[size_t(params.integer("mesh", 0, 0, count - 1))], params,
                  warn);
}

struct Corner {
    Vec3 p;
    Vec2 uv;
};

/// A flat-shaded mesh of quads, given by their vertices, counter-clockwise seen from the front.
std::unique_ptr<Shape> make_quads(const std::vector<std::array<Corner, 4>>& quads,
                                  const Params& params) {
    const Transform t = params.transform("to_world");
    // A mirroring transform reverses the winding, but must not reverse the documented normal of the shape.
    const bool turn = (t.determinant3() < 0) != params.flag("flip_normals", false);
    TriangleMesh::Arrays arrays;
    for (const auto& q : quads) {
        const auto base = uint32_t(arrays.positions.size());
        for (const Corner& c : q) {
            arrays.positions.push_back(t.point(c.p));
            arrays.uvs.push_back(c.uv);
        }
        for (TriangleMesh::Triangle tri : {TriangleMesh::Triangle{0, 1, 2}, {0, 2, 3}}) {
            if (turn) std::swap(tri[1], tri[2]);
            arrays.triangles.push_back({base + tri[0], base + tri[1], base + tri[2]});
        }
    }
    auto mesh = std::make_unique<TriangleMesh>(std::move(arrays));
    if (mesh->faces().empty()) params.fail("to_world", "\"to_world\" gives the shape zero area");
    return mesh;
}

std::unique_ptr<Shape> make_rectangle(const Params& params, const Warn&) {
    return make_quads({{Corner{{-1, -1, 0}, {0, 0}},
                        {{1, -1, 0}, {1, 0}},
                        {{1, 1, 0}, {1, 1}},
                        {{-1, 1, 0}, {0, 1}}}},
                      params);
}

/// The cube [-1, 1]³, with the texture coordinates of Mitsuba's cube.
std::unique_ptr<Shape> make_cube(const Params& params, const Warn&) {
    // Normal, and the directions of u and v.
    struct Face {
        Vec3 n, u, v;
    };
    const Face faces[] = {{{0, 0, 1}, {0, 1, 0}, {1, 0, 0}},   {{0, 0, -1}, {0, -1, 0}, {1, 0, 0}},
                          {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}},  {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                          {{0, 1, 0}, {-1, 0, 0}, {0, 0, -1}}, {{0, -1, 0}, {0, 0, 1}, {1, 0, 0}}};
    std::vector<std::array<Corner, 4>> quads;
    for (const Face& f : faces) {
        std::array<Corner, 4> q = {Corner{f.n - f.u - f.v, {0, 0}},
                                   {f.n + f.u - f.v, {1, 0}},
                                   {f.n + f.u + f.v, {1, 1}},
                                   {f.n - f.u + f.v, {0, 1}}};
        if (dot(cross(f.u, f.v), f.n) < 0) std::swap(q[1], q[3]);
        quads.push_back(q);
    }
    return make_quads(quads, params);
}

/// Whether `t` has no shear and scales x and y (for `uniform` also z) equally.
bool is_similarity(const Transform& t, bool uniform) {
    const Vec3 x = t.vector({1, 0, 0}), y = t.vector({0, 1, 0}), z = t.vector({0, 0, 1});
    const float lx = length(x), ly = length(y), lz = length(z);
    const bool orthogonal = std::fabs(dot(x, y)) < 1e-3f * lx * ly &&
                            std::fabs(dot(y, z)) < 1e-3f * ly * lz &&
                            std::fabs(dot(z, x)) < 1e-3f * lz * lx;
    return orthogonal && std::fabs(lx - ly) < 1e-3f * lx &&
           (!uniform || std::fabs(lx - lz) < 1e-3f * lx);
}

/// A mesh of `columns` × `rows` squares; `vertex(u, v)` returns position and normal for (u, v) in the unit square.
template <class Vertex>
MeshData grid_mesh(int columns, int rows, const Vertex& vertex) {
    MeshData mesh;
    for (int j = 0; j <= rows; ++j)
        for (int i = 0; i <= columns; ++i) {
            const Vec2 uv{float(i) / float(columns), float(j) / float(rows)};
            const auto [p, n] = vertex(uv);
            mesh.positions.push_back(p);
            mesh.normals.push_back(n);
            mesh.uvs.push_back(uv);
        }
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < columns; ++i) {
            const auto a = uint32_t(j * (columns + 1) + i), b = a + 1,
                       c = a + uint32_t(columns) + 1, d = c + 1;
            mesh.triangles.push_back({a, b, d});
            mesh.triangles.push_back({a, d, c});
        }
    return mesh;
}

constexpr int kColumns = 128, kRows = 64;  ///< Of the mesh of a stretched quadric.

std::unique_ptr<Shape> finish_quadric(MeshData mesh, const Params& params, const Warn& warn) {
    warn(
        fmt::format("\"to_world\" stretches or shears the {}: it becomes a mesh of {} × {} squares",
                    params.object().type, kColumns, kRows));
    finish_mesh(mesh, {}, params.where());
    mesh.dropped_degenerate = 0;  // those at the poles of a sphere
    return finish(std::move(mesh), params, warn);
}

std::unique_ptr<Shape> make_sphere(const Params& params, const Warn& warn) {
    const Transform t = params.transform("to_world");
    const float radius = params.number("radius", 1, 1e-20f);
    const Vec3 center = params.vector("center", {0, 0, 0});
    if (is_similarity(t, true)) {
        const Transform local =
            Transform::translate(center) * Transform::scale({radius, radius, radius});
        return std::make_unique<Sphere>(t * local, params.flag("flip_normals", false));
    }
    return finish_quadric(grid_mesh(kColumns, kRows,
                                    [&](Vec2 uv) {
                                        const float phi = 2 * kPi * uv.x, theta = kPi * uv.y;
                                        const Vec3 n{std::sin(theta) * std::cos(phi),
                                                     std::sin(theta) * std::sin(phi),
                                                     std::cos(theta)};
                                        return std::pair(center + n * radius, n);
                                    }),
                          params, warn);
}

std::unique_ptr<Shape> make_disk(const Params& params, const Warn&) {
    return std::make_unique<Disk>(params.transform("to_world"), params.flag("flip_normals", false));
}

std::unique_ptr<Shape> make_cylinder(const Params& params, const Warn& warn) {
    const Vec3 p0 = params.vector("p0", {0, 0, 0}), p1 = params.vector("p1", {0, 0, 1});
    const float radius = params.number("radius", 1, 1e-20f);
    const Vec3 axis = p1 - p0;
    const float height = length(axis);
    if (!(height > 0))
        params.fail("p1", fmt::format("\"p0\" and \"p1\" of a cylinder must differ, but both "
                                      "are ({}, {}, {})",
                                      p1.x, p1.y, p1.z));
    const Transform t = params.transform("to_world");
    // Columns: two vectors of length `radius` normal to the axis, the axis, and p0. The choice of the two determines
    // where u = 0; these are those of Mitsuba 3.
    const Frame frame = Frame::from_normal(axis / height);
    const Vec3 s = frame.s * radius, r = frame.t * radius;
    const Transform local(Transform::Matrix{{{s.x, r.x, axis.x, p0.x},
                                             {s.y, r.y, axis.y, p0.y},
                                             {s.z, r.z, axis.z, p0.z},
                                             {0, 0, 0, 1}}});
    if (is_similarity(t * local, false))
        return std::make_unique<Cylinder>(t * local, params.flag("flip_normals", false));
    return finish_quadric(grid_mesh(kColumns, kRows,
                                    [&](Vec2 uv) {
                                        const float phi = 2 * kPi * uv.x;
                                        const Vec3 n =
                                            frame.s * std::cos(phi) + frame.t * std::sin(phi);
                                        return std::pair(p0 + n * radius + axis * uv.y, n);
                                    }),
                          params, warn);
}

}  // namespace

const std::vector<ShapeEntry>& shape_registry() {
    static const std::vector<ShapeEntry> entries = {
        {{"shape", "obj", "Wavefront mesh.", mesh_params("true")},
         [](const Params& p, const Warn& w) { return make_file_mesh<read_obj>(p, w, true); }},
        {{"shape", "ply", "PLY mesh, ascii or binary.", mesh_params("false")},
         [](const Params& p, const Warn& w) { return make_file_mesh<read_ply>(p, w, false); }},
        {{"shape", "mesh", "Triangles that are part of the scene file (pbrt, glTF).",
          with_common({{"mesh", ParamKind::Int, "",
                        "Index of the mesh among those of the scene file, from 0."},
                       {"face_normals", ParamKind::Bool, "false",
                        "Flat shading: vertex normals are ignored."},
                       kComputeNormals,
                       kFlipFlatNormals})},
         make_own_mesh},
        {{"shape", "serialized", "Compressed mesh of Mitsuba 0.6.", mesh_params("false")},
         [](const Params& p, const Warn& w) {
             const int index = int(p.integer("shape_index", 0, 0, 1 << 24));
             const MeshOptions options{.flip_tex_coords = p.flag("flip_tex_coords", false)};
             return finish(
                 read_mesh(
                     p, [&](const std::string& f) { return read_serialized(f, index, options); }),
                 p, w);
         }},
        {{"shape", "rectangle", "The square [-1, 1]² in the xy plane, normal +z.", with_common({})},
         make_rectangle},
        {{"shape", "cube", "The cube [-1, 1]³, normals outward.", with_common({})}, make_cube},
        {{"shape", "sphere", "Sphere, normals outward.",
          with_common({{"center", ParamKind::Vector, "0, 0, 0", "Centre."},
                       {"radius", ParamKind::Float, "1", "Radius."}})},
         make_sphere},
        {{"shape", "disk", "The unit disc in the xy plane, normal +z.", with_common({})},
         make_disk},
        {{"shape", "cylinder", "Open cylinder, normals outward.",
          with_common({{"p0", ParamKind::Vector, "0, 0, 0", "Start of the axis."},
                       {"p1", ParamKind::Vector, "0, 0, 1", "End of the axis."},
                       {"radius", ParamKind::Float, "1", "Radius."}})},
         make_cylinder},
    };
    return entries;
}

const std::vector<PluginInfo>& group_infos() {
    static const std::vector<PluginInfo> infos = {
        {"shape",
         "shapegroup",
         "Shapes that appear only through instances; groups may be nested.",
         {{"shape", ParamKind::Object, "", "Nested shapes."}}},
        {"shape",
         "instance",
         "A copy of a shapegroup.",
         {{"to_world", ParamKind::Transform, "identity", "Group-to-world transform."},
          {"shapegroup", ParamKind::Object, "", "Reference to the group."}}},
        {"shape",
         "merge",
         "Several shapes, as if each were given separately.",
         {{"shape", ParamKind::Object, "", "Nested shapes."}}}};
    return infos;
}

}  // namespace etendue
