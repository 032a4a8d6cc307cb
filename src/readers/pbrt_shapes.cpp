// pbrt's shapes. Meshes without vertex normals are flat, materials reflect on both sides, and texture coordinates are
// those of the file.

#include <cmath>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"
#include "readers/pbrt_scene.h"
#include "readers/pbrt_surfaces.h"

namespace etendue {
namespace {

int add_shape(PbrtScene& scene, const PbrtArguments& args, const char* type) {
    const int shape = scene.add("shape", type, args.where());
    scene.description.objects.back().params.reserve(2);  // as many as most have
    if (!scene.state.ctm.is_identity()) scene.set(shape, "to_world", scene.state.ctm);
    return shape;
}

int finish(PbrtScene& scene, const PbrtArguments& args, int shape) {
    scene.place_shape(shape, args);
    return shape;
}

/// ReverseOrientation: pbrt-v3 does not turn the normals that a mesh has.
void set_mesh_orientation(PbrtScene& scene, int shape) {
    scene.set(shape, "compute_normals", false);
    if (scene.state.reverse_orientation)
        scene.set(shape, scene.is_v3() ? "flip_flat_normals" : "flip_normals", true);
}

/// A mesh that the description holds.
int add_mesh(PbrtScene& scene, const PbrtArguments& args, MeshData mesh) {
    finish_mesh(mesh, {}, args.where());
    if (!scene.watch.add(memory_bytes(mesh)))
        args.fail("the meshes of the scene need more memory than is free");
    const int shape = add_shape(scene, args, "mesh");
    scene.set(shape, "mesh", int64_t(scene.description.meshes.size()));
    scene.description.meshes.push_back(std::move(mesh));
    set_mesh_orientation(scene, shape);
    return finish(scene, args, shape);
}

int make_plymesh(PbrtScene& scene, const PbrtArguments& args) {
    const int shape = add_shape(scene, args, "ply");
    scene.set(shape, "filename", args.text("filename", ""));
    set_mesh_orientation(scene, shape);
    if (args.has("displacement"))
        scene.reject(args.find("displacement")->where, "displaced meshes are not supported");
    return finish(scene, args, shape);
}

std::vector<Vec3> vectors(const PbrtArguments& args, const char* name) {
    const std::vector<float>& n = args.numbers(name, 3);
    std::vector<Vec3> out(n.size() / 3);
    for (size_t i = 0; i < out.size(); ++i) out[i] = {n[3 * i], n[3 * i + 1], n[3 * i + 2]};
    return out;
}

/// Positions, normals and texture coordinates of a mesh in the file.
MeshData read_vertices(const PbrtArguments& args) {
    MeshData mesh;
    mesh.name = args.name();
    mesh.positions = vectors(args, "P");
    if (mesh.positions.empty())
        args.fail(fmt::format("{} \"{}\" needs \"point3 P\"", args.kind(), args.name()));
    mesh.normals = vectors(args, "N");
    const char* uv_name = args.has("uv") ? "uv" : args.has("st") ? "st" : "uv";
    const std::vector<float>& uv = args.numbers(uv_name, 2);
    mesh.uvs.resize(uv.size() / 2);
    for (size_t i = 0; i < mesh.uvs.size(); ++i) mesh.uvs[i] = {uv[2 * i], uv[2 * i + 1]};
    const size_t n = mesh.positions.size();
    if (!mesh.normals.empty() && mesh.normals.size() != n)
        args.fail("N", fmt::format("there are {} normals, but {} points", mesh.normals.size(), n));
    if (!mesh.uvs.empty() && mesh.uvs.size() != n)
        args.fail(uv_name, fmt::format("there are {} texture coordinates, but {} points",
                                       mesh.uvs.size(), n));
    return mesh;
}

/// Indices of vertices, `corners` of each face; those of one face where none are given.
std::vector<uint32_t> read_indices(const PbrtArguments& args, size_t corners, size_t vertices) {
    const std::vector<int>& given = args.integers("indices");
    if (!args.has("indices") && vertices != corners)
        args.fail(fmt::format("{} \"{}\" needs \"integer indices\"", args.kind(), args.name()));
    if (given.size() % corners != 0)
        args.fail("indices",
                  fmt::format("there are {} indices, not a multiple of {}", given.size(), corners));
    std::vector<uint32_t> indices(given.begin(), given.end());
    for (size_t i = 0; i < given.size(); ++i)
        if (given[i] < 0 || size_t(given[i]) >= vertices)
            args.fail("indices", fmt::format("index {} is out of range: there are {} points",
                                             given[i], vertices));
    if (given.empty())
        for (uint32_t i = 0; i < corners; ++i) indices.push_back(i);
    return indices;
}

int make_trianglemesh(PbrtScene& scene, const PbrtArguments& args) {
    MeshData mesh = read_vertices(args);
    const std::vector<uint32_t> indices = read_indices(args, 3, mesh.positions.size());
    mesh.triangles.resize(indices.size() / 3);
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
        mesh.triangles[i] = {indices[3 * i], indices[3 * i + 1], indices[3 * i + 2]};
    return add_mesh(scene, args, std::move(mesh));
}

int make_bilinearmesh(PbrtScene& scene, const PbrtArguments& args) {
    if (args.has("emissionfilename"))
        scene.reject(args.find("emissionfilename")->where,
                     "emission distributions of bilinear meshes are not supported");
    const MeshData vertices = read_vertices(args);
    return add_mesh(scene, args,
                    bilinear_patches(vertices, read_indices(args, 4, vertices.positions.size())));
}

int make_loopsubdiv(PbrtScene& scene, const PbrtArguments& args) {
    MeshData mesh;
    mesh.name = args.name();
    mesh.positions = vectors(args, "P");
    const std::vector<uint32_t> indices = read_indices(args, 3, mesh.positions.size());
    for (size_t i = 0; i + 2 < indices.size(); i += 3)
        mesh.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
    const char* levels = scene.is_v3() && args.has("nlevels") ? "nlevels" : "levels";
    return add_mesh(scene, args,
                    loop_subdivide(std::move(mesh), args.integer(levels, 3, 0, 8), args.where()));
}

/// Whether angles stay right ones and x and y, or all three axes, keep their ratios.
bool is_similarity(const Transform& t, bool with_z) {
    constexpr float kTolerance = 1e-4f;
    const Vec3 x = t.vector({1, 0, 0}), y = t.vector({0, 1, 0}), z = t.vector({0, 0, 1});
    const float lx = length(x), ly = length(y), lz = length(z);
    return std::fabs(dot(x, y)) < kTolerance * lx * ly &&
           std::fabs(dot(y, z)) < kTolerance * ly * lz &&
           std::fabs(dot(z, x)) < kTolerance * lz * lx && std::fabs(lx - ly) < kTolerance * lx &&
           (!with_z || std::fabs(lx - lz) < kTolerance * lx);
}

void set_flip(PbrtScene& scene, int shape) {
    if (scene.state.reverse_orientation) scene.set(shape, "flip_normals", true);
}

/// What no quadric of etendue is, as a fine mesh.
int add_tessellated(PbrtScene& scene, const PbrtArguments& args, const Revolution& surface) {
    scene.warn(
        args.where(),
        fmt::format("this {} is made of triangles, as it is not whole or not round", args.name()));
    return add_mesh(scene, args, tessellate(surface));
}

float phi_max(const PbrtArguments& args) {
    return args.number("phimax", 360, 1e-3f, 360) * kPi / 180;
}

[[noreturn]] void fail_order(const PbrtArguments& args, const char* lower, float x,
                             const char* upper, float y) {
    args.fail(lower, fmt::format("the {} of a {} is {}, but must be below its {}, {}", lower,
                                 args.name(), x, upper, y));
}

int make_sphere(PbrtScene& scene, const PbrtArguments& args) {
    const float r = args.number("radius", 1, 1e-20f);
    const float z0 = clamp(args.number("zmin", -r), -r, r),
                z1 = clamp(args.number("zmax", r), -r, r);
    const bool is_whole = z0 <= -r && z1 >= r && phi_max(args) >= 2 * kPi;
    if (!is_whole || !is_similarity(scene.state.ctm, true)) {
        if (!(z0 < z1)) fail_order(args, "zmin", z0, "zmax", z1);
        return add_tessellated(scene, args, sphere_surface(r, z0, z1, phi_max(args)));
    }
    const int shape = add_shape(scene, args, "sphere");
    scene.set(shape, "radius", double(r));
    set_flip(scene, shape);
    return finish(scene, args, shape);
}

int make_cylinder(PbrtScene& scene, const PbrtArguments& args) {
    const float r = args.number("radius", 1, 1e-20f);
    const float z0 = args.number("zmin", -1), z1 = args.number("zmax", 1);
    if (!(z0 < z1)) fail_order(args, "zmin", z0, "zmax", z1);
    if (phi_max(args) < 2 * kPi || !is_similarity(scene.state.ctm, false))
        return add_tessellated(scene, args, cylinder_surface(r, z0, z1, phi_max(args)));
    const int shape = add_shape(scene, args, "cylinder");
    scene.set(shape, "p0", Vec3{0, 0, z0});
    scene.set(shape, "p1", Vec3{0, 0, z1});
    scene.set(shape, "radius", double(r));
    set_flip(scene, shape);
    return finish(scene, args, shape);
}

int make_disk(PbrtScene& scene, const PbrtArguments& args) {
    const float r = args.number("radius", 1, 1e-20f), inner = args.number("innerradius", 0, 0);
    const float h = args.number("height", 0);
    if (!(inner < r)) fail_order(args, "innerradius", inner, "radius", r);
    if (inner > 0 || phi_max(args) < 2 * kPi)
        return add_tessellated(scene, args, disk_surface(r, inner, h, phi_max(args)));
    const int shape = scene.add("shape", "disk", args.where());
    scene.set(shape, "to_world",
              scene.state.ctm * Transform::translate({0, 0, h}) * Transform::scale({r, r, 1}));
    set_flip(scene, shape);
    return finish(scene, args, shape);
}

int make_cone(PbrtScene& scene, const PbrtArguments& args) {
    return add_tessellated(scene, args,
                           cone_surface(args.number("radius", 1, 1e-20f),
                                        args.number("height", 1, 1e-20f), phi_max(args)));
}

int make_paraboloid(PbrtScene& scene, const PbrtArguments& args) {
    const float z0 = args.number("zmin", 0, 0), z1 = args.number("zmax", 1, 1e-20f);
    if (!(z0 < z1)) fail_order(args, "zmin", z0, "zmax", z1);
    return add_tessellated(
        scene, args, paraboloid_surface(args.number("radius", 1, 1e-20f), z0, z1, phi_max(args)));
}

std::vector<PbrtParamInfo> with_alpha(std::vector<PbrtParamInfo> params) {
    params.push_back(
        {"alpha", ParamKind::Texture, "1",
         "Opacity: becomes a mask. v3: where it is not exactly 0 the shape would be opaque."});
    params.push_back({"shadowalpha", ParamKind::Texture, "",
                      "Without effect, with a warning where it differs: shadows use alpha.", kV3});
    return params;
}

constexpr PbrtParamInfo kPhiMax = {"phimax", ParamKind::Float, "360",
                                   "Degrees swept; less becomes a mesh."};

std::vector<PbrtParamInfo> vertex_params() {
    return {{"P", ParamKind::Vector, "", "Points."},
            {"indices", ParamKind::Int, "", "Points of each face."},
            {"N", ParamKind::Vector, "", "Normals of the points; flat without them."},
            {"uv", ParamKind::Vector, "", "Texture coordinates of the points."},
            {"st", ParamKind::Vector, "", "Another name of uv, which counts if both are given."},
            {"S", ParamKind::Vector, "", "Accepted; tangents follow uv."},
            {"faceIndices", ParamKind::Int, "", "Accepted; without effect."},
            {"discarddegenerateUVs", ParamKind::Bool, "", "Accepted; without effect."}};
}

}  // namespace

const std::vector<PbrtEntry>& pbrt_shapes() {
    static const std::vector<PbrtEntry> entries = [] {
        std::vector<PbrtParamInfo> bilinear = vertex_params();
        bilinear.push_back({"emissionfilename", ParamKind::String, "", "Rejected."});
        return std::vector<PbrtEntry>{
            {"plymesh", kV3And4, "Becomes ply; .ply.gz, too.",
             with_alpha({{"filename", ParamKind::String, "", "Mesh file."},
                         {"displacement", ParamKind::Texture, "", "Rejected.", kV4},
                         {"edgelength", ParamKind::Float, "", "Accepted; without effect.", kV4}}),
             make_plymesh},
            {"trianglemesh", kV3And4, "Becomes mesh.", with_alpha(vertex_params()),
             make_trianglemesh},
            {"bilinearmesh", kV4,
             "Becomes mesh: two triangles for a flat patch, 16 x 16 squares for others.",
             with_alpha(bilinear), make_bilinearmesh},
            {"loopsubdiv", kV3And4, "Becomes mesh, subdivided and moved to the limit surface.",
             with_alpha({{"P", ParamKind::Vector, "", "Points."},
                         {"indices", ParamKind::Int, "", "Points of each triangle."},
                         {"levels", ParamKind::Int, "3", "How often each triangle becomes four."},
                         {"nlevels", ParamKind::Int, "3", "Another name of levels.", kV3},
                         {"scheme", ParamKind::String, "loop", "Accepted; without effect."}}),
             make_loopsubdiv},
            {"sphere", kV3And4, "Becomes sphere; a mesh where it is cut off or scaled unevenly.",
             with_alpha({{"radius", ParamKind::Float, "1", "Radius."},
                         {"zmin", ParamKind::Float, "-radius", "Lower end."},
                         {"zmax", ParamKind::Float, "radius", "Upper end."},
                         kPhiMax}),
             make_sphere},
            {"cylinder", kV3And4,
             "Becomes cylinder; a mesh where it is cut off or scaled unevenly.",
             with_alpha({{"radius", ParamKind::Float, "1", "Radius."},
                         {"zmin", ParamKind::Float, "-1", "Lower end."},
                         {"zmax", ParamKind::Float, "1", "Upper end."},
                         kPhiMax}),
             make_cylinder},
            {"disk", kV3And4, "Becomes disk; a mesh where it has a hole or is cut off.",
             with_alpha({{"radius", ParamKind::Float, "1", "Radius."},
                         {"innerradius", ParamKind::Float, "0", "Radius of the hole."},
                         {"height", ParamKind::Float, "0", "z of the disk."},
                         kPhiMax}),
             make_disk},
            {"cone", kV3, "Becomes mesh.",
             with_alpha({{"radius", ParamKind::Float, "1", "Radius at z = 0."},
                         {"height", ParamKind::Float, "1", "z of the tip."},
                         kPhiMax}),
             make_cone},
            {"paraboloid", kV3, "Becomes mesh.",
             with_alpha({{"radius", ParamKind::Float, "1", "Radius at zmax."},
                         {"zmin", ParamKind::Float, "0", "Lower end."},
                         {"zmax", ParamKind::Float, "1", "Upper end."},
                         kPhiMax}),
             make_paraboloid},
            {"curve", kV3And4, "Rejected: curves are not supported.", {}, nullptr},
            {"hyperboloid", kV3, "Rejected: hyperboloids are not supported.", {}, nullptr},
            {"heightfield", kV3, "Rejected: height fields are not supported.", {}, nullptr},
            {"nurbs", kV3, "Rejected: NURBS are not supported.", {}, nullptr},
        };
    }();
    return entries;
}

}  // namespace etendue
