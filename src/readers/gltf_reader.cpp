#include "readers/gltf_reader.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include <fmt/format.h>

#include "description/json_text.h"
#include "description/resolve_file.h"
#include "readers/file_bytes.h"
#include "readers/gltf.h"
#include "readers/object_graph.h"

namespace etendue {
namespace {

constexpr int kDeepestObjects = 64;

Vec3 vec3(const std::vector<double>& v) {
    return {float(v[0]), float(v[1]), float(v[2])};
}

/// The rotation of a quaternion (x, y, z, w) of any length above zero.
Transform rotation(const std::vector<double>& q, const JsonValue& where) {
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(length > 0)) where.fail("a rotation must not be zero");
    const double x = q[0] / length, y = q[1] / length, z = q[2] / length, w = q[3] / length;
    return Transform(
        Transform::Matrix{{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0},
                           {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0},
                           {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0},
                           {0, 0, 0, 1}}});
}

Transform local_transform(const JsonValue& node) {
    if (node["matrix"]) {
        const std::vector<double> m = node["matrix"].numbers(16, {});
        Transform::Matrix rows;
        for (size_t i = 0; i < 16; ++i) rows[i % 4][i / 4] = m[i];
        return Transform(rows);
    }
    return Transform::translate(vec3(node["translation"].numbers(3, {0, 0, 0}))) *
           rotation(node["rotation"].numbers(4, {0, 0, 0, 1}), node["rotation"]) *
           Transform::scale(vec3(node["scale"].numbers(3, {1, 1, 1})));
}

/// Cameras and lights of glTF look along -z with x to the right; those of the description along +z with x to the left.
Transform turned() {
    return Transform::scale({-1, 1, -1});
}

/// The position and the directions of a transform without its scale, which cameras ignore. Empty where it has no
/// direction to look in.
std::optional<Transform> without_scale(const Transform& t) {
    const Vec3 back = t.vector({0, 0, 1}), up = t.vector({0, 1, 0}), p = t.point({0, 0, 0});
    if (!(length2(back) > 0) || !(length2(up) > 0)) return {};
    const Vec3 z = normalize(back), side = cross(normalize(up), z);
    if (!(length2(side) > 0)) return {};
    const Vec3 x = normalize(side), y = cross(z, x);
    return Transform(Transform::Matrix{
        {{x.x, y.x, z.x, p.x}, {x.y, y.y, z.y, p.y}, {x.z, y.z, z.z, p.z}, {0, 0, 0, 1}}});
}

bool is_known_extension(const std::string& name) {
    const std::vector<std::string>& known = gltf_extensions();
    return std::find(known.begin(), known.end(), name) != known.end();
}

}  // namespace

GltfReader::GltfReader(const std::string& file, const ReadOptions& options,
                       const nlohmann::json& document, std::string_view chunk)
    : options_(options), file_(file), root_(&document, &file_, ""),
      nodes_(root_["nodes"].elements()), meshes_(root_["meshes"].elements()),
      materials_(root_["materials"].elements()), textures_(root_["textures"].elements()),
      images_(root_["images"].elements()), samplers_(root_["samplers"].elements()),
      cameras_(root_["cameras"].elements()),
      lights_(root_["extensions"]["KHR_lights_punctual"]["lights"].elements()),
      buffers_(root_, chunk, [this](const std::string& name, const JsonValue& where) {
          const std::string& folder = scene_.search_paths[0];
          for (const std::string& spelling : spellings(name)) {
              const auto path = (std::filesystem::path(folder) / spelling).lexically_normal();
              if (auto bytes = read_named_file(options_, path.string(), where.where()))
                  return *std::move(bytes);
          }
          where.fail(fmt::format("cannot read the file {}{}",
                                 (std::filesystem::path(folder) / name).lexically_normal().string(),
                                 options_.is_disk ? near_file_hint(name, {folder}) : ""));
      }) {
    scene_.file = file;
    scene_.search_paths.push_back(directory_of(file));
    visited_.resize(nodes_.size());
}

int GltfReader::add(const char* category, const char* type, const JsonValue& where) {
    scene_.objects.push_back({.category = category,
                              .type = type,
                              .id = {},
                              .where = where.where(),
                              .params = {},
                              .children = {}});
    return int(scene_.objects.size()) - 1;
}

void GltfReader::set(int object, const char* name, ParamValue value) {
    SceneObject& o = scene_.objects[size_t(object)];
    o.params.push_back({name, std::move(value), o.where});
}

void GltfReader::add_child(int parent, const char* name, int object) {
    SceneObject& o = scene_.objects[size_t(parent)];
    o.children.push_back({name, object, o.where});
}

void GltfReader::warn(const std::string& message) {
    scene_.warnings.push_back(fmt::format("{}: {}", file_.str(), message));
}

void GltfReader::reject(const JsonValue& where, const std::string& message) {
    if (!options_.lenient) where.fail(message);
    ++scene_.left_out;
    warn(fmt::format("{}: {}; left out", where.path(), message));
}

void GltfReader::watch(size_t bytes, const JsonValue& where) {
    if (!watch_.add(bytes)) where.fail("the scene needs more memory than is free");
}

SceneDescription GltfReader::read() {
    const std::string version = root_["asset"]["version"].text("");
    if (version.rfind("2.", 0) != 0)
        root_["asset"]["version"].fail(
            fmt::format("is \"{}\", but only glTF 2 is supported", version));
    check_extensions();
    read_scene();
    place_meshes();
    if (!has_camera_) add_default_camera();
    if (!has_light_) {
        warn("there is no light: a white environment of radiance 1 is added");
        scene_.roots.push_back(add("emitter", "constant", root_));
    }
    check_object_graph(scene_, kDeepestObjects);
    return std::move(scene_);
}

void GltfReader::check_extensions() {
    for (const JsonValue& e : root_["extensionsRequired"].elements())
        if (const std::string name = e.text(""); !is_known_extension(name))
            reject(e, fmt::format("the extension {} is not supported", name));
    for (const JsonValue& e : root_["extensionsUsed"].elements())
        if (const std::string name = e.text(""); !is_known_extension(name))
            warn(fmt::format("the extension {} is not supported and has no effect", name));
    if (root_["extensions"]["KHR_materials_variants"])
        warn("variants of materials are not supported: the default materials are used");
    if (root_["animations"]) warn("animations are not supported: the scene is as at rest");
    if (root_["skins"]) warn("skins are not supported: meshes are as at rest");
}

// ---- Nodes

void GltfReader::read_scene() {
    check_gpu_instances();
    const std::vector<JsonValue> scenes = root_["scenes"].elements();
    std::vector<size_t> roots;
    if (scenes.empty()) {
        std::vector<bool> is_child(nodes_.size());
        for (const JsonValue& node : nodes_)
            for (const JsonValue& c : node["children"].elements())
                is_child[*c.index(nodes_.size())] = true;
        for (size_t i = 0; i < nodes_.size(); ++i)
            if (!is_child[i]) roots.push_back(i);
    } else {
        for (const JsonValue& n :
             scenes[root_["scene"].index(scenes.size()).value_or(0)]["nodes"].elements())
            roots.push_back(*n.index(nodes_.size()));
    }
    // Depth first; not recursive, since nodes may be nested deeply.
    struct Pending {
        size_t node;
        Transform parent;
    };
    std::vector<Pending> pending;
    for (size_t i = roots.size(); i-- > 0;) pending.push_back({roots[i], Transform()});
    while (!pending.empty()) {
        const Pending next = pending.back();
        pending.pop_back();
        const JsonValue& node = nodes_[next.node];
        if (visited_[next.node]) node.fail("the node occurs twice in the scene");
        visited_[next.node] = true;
        const Transform to_world = next.parent * local_transform(node);
        read_node(node, to_world);
        const std::vector<JsonValue> children = node["children"].elements();
        for (size_t i = children.size(); i-- > 0;)
            pending.push_back({*children[i].index(nodes_.size()), to_world});
    }
}

void GltfReader::read_node(const JsonValue& node, const Transform& to_world) {
    for (const auto& row : to_world.matrix())
        for (const double v : row)
            if (!std::isfinite(v)) node.fail("the transform is not finite");
    if (const auto mesh = node["mesh"].index(meshes_.size())) {
        if (!to_world.is_invertible()) {
            warn(fmt::format("{}: a mesh without extent is left out", node.path()));
        } else {
            for (const Transform& t : gpu_instances(node)) {
                if (!t.is_invertible()) continue;
                placements_.push_back({*mesh, to_world * t});
                // An instance, its transform and its place in the scene follow.
                watch(sizeof(Placement) + 2 * sizeof(SceneObject) + sizeof(Transform), node);
            }
        }
    }
    if (const auto camera = node["camera"].index(cameras_.size())) {
        const size_t before = scene_.objects.size();
        add_camera(cameras_[*camera], to_world);
        std::string name = cameras_[*camera]["name"].text("");
        if (name.empty()) name = node["name"].text("");
        scene_.objects[before].id = name;
    }
    if (const auto light = node["extensions"]["KHR_lights_punctual"]["light"].index(lights_.size()))
        add_light(lights_[*light], to_world);
}

/// Nodes may share their accessors, so the size of the file does not limit what they place.
void GltfReader::check_gpu_instances() const {
    constexpr size_t kMost = 1 << 22;
    size_t sum = 0;
    for (const JsonValue& node : nodes_) {
        const JsonValue attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        size_t count = 0;
        for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"})
            if (const JsonValue accessor = attributes[name])
                count = std::max(count, buffers_.count(accessor));
        if (count > kMost - sum)
            node.fail(fmt::format("EXT_mesh_gpu_instancing places more than {} meshes in the scene",
                                  kMost));
        sum += count;
    }
}

/// The transforms of EXT_mesh_gpu_instancing; the identity where the node has none.
std::vector<Transform> GltfReader::gpu_instances(const JsonValue& node) {
    const JsonValue attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
    if (!attributes) return {Transform()};
    const JsonValue names[] = {attributes["TRANSLATION"], attributes["ROTATION"],
                               attributes["SCALE"]};
    const char* types[] = {"VEC3", "VEC4", "VEC3"};
    GltfBuffers::Values values[3];
    size_t count = 0;
    for (int i = 0; i < 3; ++i)
        if (names[i]) {
            buffers_.require_bytes(names[i]);
            values[i] = buffers_.floats(names[i], types[i]);
            count = std::max(count, values[i].count);
        }
    std::vector<Transform> instances(count);
    const auto get = [&](int which, size_t i, std::vector<double> fallback) {
        const GltfBuffers::Values& v = values[which];
        if (!names[which]) return fallback;
        if (v.count != count)
            names[which].fail(fmt::format("has {} elements, other attributes {}", v.count, count));
        const auto first = v.numbers.begin() + ptrdiff_t(i * v.components);
        return std::vector<double>(first, first + ptrdiff_t(v.components));
    };
    for (size_t i = 0; i < count; ++i)
        instances[i] = Transform::translate(vec3(get(0, i, {0, 0, 0}))) *
                       rotation(get(1, i, {0, 0, 0, 1}), names[1]) *
                       Transform::scale(vec3(get(2, i, {1, 1, 1})));
    return instances;
}

// ---- Cameras

int GltfReader::add_film(double aspect) {
    constexpr int kHeight = 720;
    const int film = add("film", "hdrfilm", root_);
    set(film, "height", int64_t(kHeight));
    set(film, "width", int64_t(std::clamp(std::lround(kHeight * aspect), 1l, 16l * kHeight)));
    return film;
}

void GltfReader::add_camera(const JsonValue& camera, const Transform& to_world) {
    constexpr double kDefaultAspect = 16.0 / 9;
    has_camera_ = true;
    const std::string type = camera["type"].text("");
    const int sensor = add("sensor", type == "orthographic" ? type.c_str() : "perspective", camera);
    const std::optional<Transform> unscaled = without_scale(to_world);
    if (!unscaled) camera.fail("the camera's transform is singular");
    Transform placed = *unscaled * turned();
    double aspect = kDefaultAspect;
    if (type == "perspective") {
        const JsonValue p = camera["perspective"];
        if (!p["yfov"]) p["yfov"].fail("is missing");
        aspect = p["aspectRatio"].number(kDefaultAspect, 1e-3, 1e3);
        set(sensor, "fov", p["yfov"].number(0, 1e-4, 3.1415) * 180 / std::numbers::pi);
        set(sensor, "fov_axis", std::string("y"));
    } else if (type == "orthographic") {
        const JsonValue o = camera["orthographic"];
        for (const char* name : {"xmag", "ymag"})
            if (!o[name]) o[name].fail("is missing");
        const double x = std::fabs(o["xmag"].number(1)), y = std::fabs(o["ymag"].number(1));
        if (!(x > 0 && y > 0))
            o.fail(fmt::format("xmag and ymag must not be zero, but are {} and {}", x, y));
        aspect = x / y;
        placed = placed * Transform::scale({float(x), float(x), 1});
    } else {
        camera["type"].fail(
            fmt::format("is \"{}\", but must be perspective or orthographic", type));
    }
    set(sensor, "to_world", placed);
    add_child(sensor, "", add_film(aspect));
    scene_.roots.push_back(sensor);
}

/// A view of the whole scene, from the front, above and to the right.
void GltfReader::add_default_camera() {
    constexpr float kFov = 35;
    warn("there is no camera: one is added that sees the whole scene");
    const Vec3 center = bounds_.is_empty() ? Vec3() : bounds_.center();
    const float radius = bounds_.is_empty() ? 1 : std::max(bounds_.radius(), 1e-6f);
    const float distance = radius / std::sin(0.5f * kFov * kPi / 180);
    const Vec3 origin = center + normalize(Vec3{0.5f, 0.4f, 1}) * distance;
    const int sensor = add("sensor", "perspective", root_);
    set(sensor, "fov", double(kFov));
    set(sensor, "fov_axis", std::string("smaller"));
    if (const auto view = Transform::look_at(origin, center, {0, 1, 0}))
        set(sensor, "to_world", *view);
    add_child(sensor, "", add_film(4.0 / 3));
    scene_.roots.push_back(sensor);
}

// ---- Lights

void GltfReader::add_light(const JsonValue& light, const Transform& to_world) {
    const std::string type = light["type"].text("");
    const std::vector<double> c = light["color"].numbers(3, {1, 1, 1});
    const double intensity = light["intensity"].number(1, 0);
    const Rgb colour = Rgb(float(c[0]), float(c[1]), float(c[2])) * float(intensity);
    const Vec3 position = to_world.point({0, 0, 0}), direction = to_world.vector({0, 0, -1});
    if (type != "point" && !(length2(direction) > 0)) light.fail("the light has no direction");
    int emitter = -1;
    if (type == "directional") {
        emitter = add("emitter", "directional", light);
        set(emitter, "irradiance", colour);
        set(emitter, "direction", direction);
    } else if (type == "point") {
        emitter = add("emitter", "point", light);
        set(emitter, "intensity", colour);
        set(emitter, "position", position);
    } else if (type == "spot") {
        const JsonValue spot = light["spot"];
        const double outer =
            spot["outerConeAngle"].number(std::numbers::pi / 4, 1e-3, std::numbers::pi / 2);
        // Exporters write equal angles with different rounding.
        const double inner =
            std::min(spot["innerConeAngle"].number(0, 0, std::numbers::pi / 2), outer);
        emitter = add("emitter", "spot", light);
        set(emitter, "intensity", colour);
        set(emitter, "cutoff_angle", std::min(outer * 180 / std::numbers::pi, 89.999));
        set(emitter, "beam_width", std::min(inner * 180 / std::numbers::pi, 89.999));
        set(emitter, "falloff", std::string("quadratic"));
        const Vec3 axis = normalize(direction);
        const auto view = Transform::look_at(
            position, position + axis, std::fabs(axis.y) < 0.9f ? Vec3{0, 1, 0} : Vec3{1, 0, 0});
        if (!view) light.fail("the light is too far away for single precision");
        set(emitter, "to_world", *view);
    } else {
        return reject(light, fmt::format("a light of the type \"{}\" is not supported", type));
    }
    has_light_ = true;
    scene_.roots.push_back(emitter);
}

// ---- Files

namespace {

uint32_t word(std::string_view bytes, size_t at) {
    uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i)
        value |= uint32_t(static_cast<unsigned char>(bytes[at + i])) << (8 * i);
    return value;
}

struct Container {
    std::string_view json, chunk;
};

/// The parts of a .glb file; any other file is JSON as a whole.
Container open_container(std::string_view bytes, const std::string& file) {
    if (bytes.substr(0, 4) != "glTF") return {bytes, {}};
    const auto fail = [&](const std::string& message) { throw SceneError({file, 0}, message); };
    if (bytes.size() < 12 || word(bytes, 4) != 2) fail("this is not a .glb file of version 2");
    constexpr uint32_t kJson = 0x4e4f534a, kBinary = 0x004e4942;
    Container found;
    for (size_t at = 12; at + 8 <= bytes.size();) {
        const uint32_t length = word(bytes, at), type = word(bytes, at + 4);
        if (length > bytes.size() - at - 8) fail("the file ends within a chunk");
        const std::string_view contents = bytes.substr(at + 8, length);
        if (type == kJson && found.json.empty()) found.json = contents;
        if (type == kBinary && found.chunk.empty()) found.chunk = contents;
        at += 8 + size_t(length);
    }
    if (found.json.empty()) fail("the file has no JSON chunk");
    return found;
}

}  // namespace

SceneDescription read_gltf(const std::string& file, const ReadOptions& options) {
    const ReadOptions all = with_disk(options);
    return parse_gltf(read_scene_bytes(file, all), file, all);
}

SceneDescription parse_gltf(std::string_view bytes, const std::string& file,
                            const ReadOptions& options) {
    const Container parts = open_container(bytes, file);
    const nlohmann::json document = parse_json(parts.json, file);
    return GltfReader(file, options, document, parts.chunk).read();
}

const std::vector<std::string>& gltf_extensions() {
    static const std::vector<std::string> names = {"KHR_materials_emissive_strength",
                                                   "KHR_materials_ior",
                                                   "KHR_materials_transmission",
                                                   "KHR_materials_volume",
                                                   "KHR_materials_clearcoat",
                                                   "KHR_materials_sheen",
                                                   "KHR_materials_specular",
                                                   "KHR_materials_anisotropy",
                                                   "KHR_materials_pbrSpecularGlossiness",
                                                   "KHR_materials_unlit",
                                                   "KHR_materials_variants",
                                                   "KHR_texture_transform",
                                                   "KHR_lights_punctual",
                                                   "KHR_mesh_quantization",
                                                   "EXT_mesh_gpu_instancing"};
    return names;
}

}  // namespace etendue
