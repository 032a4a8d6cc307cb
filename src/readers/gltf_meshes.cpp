// Meshes of glTF: their primitives become meshes of the description, placed by shapes or by instances of groups.

#include <algorithm>

#include <fmt/format.h>

#include "readers/gltf_reader.h"

namespace etendue {
namespace {

/// Triangles from the vertices of a primitive in order: triangles, a strip or a fan (modes 4, 5 and 6).
std::vector<MeshData::Triangle> triangles(const std::vector<uint32_t>& v, int64_t mode) {
    std::vector<MeshData::Triangle> found;
    if (mode == 4)
        for (size_t i = 0; i + 2 < v.size(); i += 3) found.push_back({v[i], v[i + 1], v[i + 2]});
    else
        for (size_t i = 0; i + 2 < v.size(); ++i) {
            if (mode == 6)
                found.push_back({v[i + 1], v[i + 2], v[0]});
            else if (i % 2 == 0)
                found.push_back({v[i], v[i + 1], v[i + 2]});
            else
                found.push_back({v[i + 1], v[i], v[i + 2]});
        }
    return found;
}

std::vector<Vec3> triples(const GltfBuffers::Values& v) {
    std::vector<Vec3> found(v.count);
    for (size_t i = 0; i < v.count; ++i)
        found[i] = {v.numbers[i * v.components], v.numbers[i * v.components + 1],
                    v.numbers[i * v.components + 2]};
    return found;
}

constexpr size_t kNoMaterial = size_t(-1);

}  // namespace

void GltfReader::place_meshes() {
    std::map<size_t, size_t> uses;
    for (const Placement& p : placements_) ++uses[p.mesh];
    std::map<size_t, int> groups;
    for (const Placement& placement : placements_) {
        const bool is_shared = uses[placement.mesh] > 1;
        bool has_shared_part = false;
        for (const Primitive& p : primitives(placement.mesh)) {
            for (int corner = 0; corner < 8; ++corner)
                bounds_.extend(
                    placement.to_world.point({corner & 1 ? p.bounds.hi.x : p.bounds.lo.x,
                                              corner & 2 ? p.bounds.hi.y : p.bounds.lo.y,
                                              corner & 4 ? p.bounds.hi.z : p.bounds.lo.z}));
            // Emitters cannot be instanced.
            if (!is_shared || material(p.material, p.colors).emitter >= 0)
                scene_.roots.push_back(add_shape(p, placement.to_world, false));
            else
                has_shared_part = true;
        }
        if (!has_shared_part) continue;
        const JsonValue& mesh = meshes_[placement.mesh];
        const auto [group, is_new] = groups.try_emplace(placement.mesh, 0);
        if (is_new) {
            group->second = add("shape", "shapegroup", mesh);
            for (const Primitive& p : primitives(placement.mesh))
                if (material(p.material, p.colors).emitter < 0)
                    add_child(group->second, "", add_shape(p, Transform(), true));
        }
        const int instance = add("shape", "instance", mesh);
        set(instance, "to_world", placement.to_world);
        add_child(instance, "", group->second);
        scene_.roots.push_back(instance);
    }
}

const std::vector<GltfReader::Primitive>& GltfReader::primitives(size_t mesh) {
    const auto [it, is_new] = primitives_.try_emplace(mesh);
    if (!is_new) return it->second;
    const std::string name = meshes_[mesh]["name"].text("mesh");
    for (const JsonValue& p : meshes_[mesh]["primitives"].elements())
        if (const auto made = read_primitive(p, name)) it->second.push_back(*made);
    return it->second;
}

std::optional<GltfReader::Primitive> GltfReader::read_primitive(const JsonValue& primitive,
                                                                const std::string& name) {
    const int64_t mode = primitive["mode"].integer(4, 0, 6);
    if (mode < 4) {
        warn(fmt::format("{}: points and lines are left out", primitive.path()));
        return {};
    }
    if (primitive["targets"])
        warn(fmt::format("{}: morph targets have no effect", primitive.path()));
    const JsonValue attributes = primitive["attributes"];
    // Where it is not required, the mesh may be there without compression, too.
    constexpr const char* kDraco = "KHR_draco_mesh_compression";
    if (primitive["extensions"][kDraco] &&
        !(attributes["POSITION"] && buffers_.has_bytes(attributes["POSITION"]))) {
        reject(primitive, fmt::format("{} is not supported", kDraco));
        return {};
    }
    if (!attributes["POSITION"]) {
        warn(fmt::format("{}: a mesh without positions is left out", primitive.path()));
        return {};
    }
    const size_t material_index =
        primitive["material"].index(materials_.size()).value_or(kNoMaterial);
    Primitive made{int64_t(scene_.meshes.size()), material_index, VertexColors::None, {}};

    MeshData mesh;
    mesh.name = name;
    const size_t count = buffers_.count(attributes["POSITION"]);
    std::vector<uint32_t> vertices;
    // Many primitives may share the values of all their vertices: only those of its own are read for each.
    GltfBuffers::Range used{0, count};
    if (primitive["indices"]) {
        vertices = buffers_.indices(primitive["indices"]);
        for (const uint32_t v : vertices)
            if (v >= count)
                primitive["indices"].fail(fmt::format("has the index {} of {} vertices", v, count));
        const auto [lo, hi] = std::minmax_element(vertices.begin(), vertices.end());
        if (lo != vertices.end()) used = {*lo, size_t(*hi) + 1};
        for (uint32_t& v : vertices) v -= uint32_t(used.first);
    }
    const auto read = [&](const JsonValue& attribute, const char* types) {
        if (const size_t found = buffers_.count(attribute); found != count)
            attribute.fail(
                fmt::format("has {} elements, but there are {} positions", found, count));
        return buffers_.floats(attribute, types, used);
    };
    mesh.positions = triples(read(attributes["POSITION"], "VEC3"));
    if (const JsonValue normals = attributes["NORMAL"])
        mesh.normals = triples(read(normals, "VEC3"));
    if (const JsonValue colors = attributes["COLOR_0"]) {
        GltfBuffers::Values v = read(colors, "VEC3 VEC4");
        // Integers are fractions, also where an exporter does not say so.
        if (v.largest > 0 && !v.normalized)
            for (float& x : v.numbers) x = float(double(x) / v.largest);
        for (float& x : v.numbers) x = std::clamp(x, 0.0f, 1.0f);
        mesh.colors = triples(v);
        if (v.components == 4)
            for (size_t i = 0; i < v.count; ++i) mesh.alphas.push_back(v.numbers[4 * i + 3]);
        if (std::all_of(mesh.alphas.begin(), mesh.alphas.end(), [](float a) { return a == 1; }))
            mesh.alphas.clear();
        made.colors = mesh.alphas.empty() ? VertexColors::Rgb : VertexColors::Rgba;
    }
    const Material& m = material(material_index, made.colors);
    for (size_t set = 0; set < m.uv_sets.size(); ++set)
        if (const JsonValue uvs = attributes[fmt::format("TEXCOORD_{}", m.uv_sets[set])]) {
            const GltfBuffers::Values v = read(uvs, "VEC2");
            auto& to = set == 0 ? mesh.uvs : mesh.second_uvs;
            for (size_t i = 0; i < v.count; ++i)
                to.push_back({v.numbers[2 * i], v.numbers[2 * i + 1]});
        }
    if (!primitive["indices"])
        for (size_t i = 0; i < count; ++i) vertices.push_back(uint32_t(i));
    mesh.triangles = triangles(vertices, mode);
    try {
        finish_mesh(mesh, {}, primitive.where());
    } catch (const SceneError& e) {
        if (mesh.triangles.empty()) {
            warn(fmt::format("{}: {}; left out", primitive.path(), e.message()));
            return {};
        }
        primitive.fail(e.message());
    }
    for (const Vec3 p : mesh.positions) made.bounds.extend(p);
    watch(memory_bytes(mesh), primitive);
    scene_.meshes.push_back(std::move(mesh));
    return made;
}

int GltfReader::add_shape(const Primitive& primitive, const Transform& to_world, bool in_group) {
    const Material& m = material(primitive.material, primitive.colors);
    const int shape = add("shape", "mesh", root_);
    set(shape, "mesh", primitive.mesh);
    set(shape, "compute_normals", false);
    if (!to_world.is_identity()) set(shape, "to_world", to_world);
    add_child(shape, "", m.bsdf);
    if (m.interior >= 0) add_child(shape, "interior", m.interior);
    if (m.emitter >= 0 && !in_group) {
        has_light_ = true;
        add_child(shape, "", m.emitter);
    }
    return shape;
}

}  // namespace etendue
