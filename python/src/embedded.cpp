#include "embedded.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include <fmt/format.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "image/image_io.h"
#include "readers/mitsuba_values.h"

namespace etendue::python {
namespace {

/// A read-only array of the elements of a vector in something that is shared, which it keeps alive.
template <class Number, class Owner, class T>
nb::object view(const Shared<Owner>& owner, const std::vector<T>& values) {
    constexpr size_t kColumns = sizeof(T) / sizeof(Number);
    nb::capsule kept(new Shared<Owner>(owner),
                     [](void* p) noexcept { delete static_cast<Shared<Owner>*>(p); });
    const auto* data = reinterpret_cast<const Number*>(values.data());
    using Array = nb::ndarray<nb::numpy, const Number>;
    if (kColumns == 1) return nb::cast(Array(data, {values.size()}, kept));
    return nb::cast(Array(data, {values.size(), kColumns}, kept));
}

nb::object to_python(const Shared<MeshData>& mesh) {
    // All members are named, so that a new one does not compile until dicts have it, or it is left out here. The counts
    // and notes are those of the reader.
    const auto& [name, positions, normals, uvs, second_uvs, colors, alphas, triangles, face_normals,
                 dropped_degenerate, replaced_normals, notes] = *mesh;
    nb::dict d;
    if (!name.empty()) d["name"] = name;
    d["positions"] = view<float>(mesh, positions);
    d["triangles"] = view<uint32_t>(mesh, triangles);
    if (!normals.empty()) d["normals"] = view<float>(mesh, normals);
    if (!uvs.empty()) d["uvs"] = view<float>(mesh, uvs);
    if (!second_uvs.empty()) d["second_uvs"] = view<float>(mesh, second_uvs);
    if (!colors.empty()) d["colors"] = view<float>(mesh, colors);
    if (!alphas.empty()) d["alphas"] = view<float>(mesh, alphas);
    if (face_normals) d["face_normals"] = true;
    return d;
}

/// "one of shape (2, 3) of float64".
std::string described(nb::handle array) {
    return fmt::format("one of shape {} of {}",
                       nb::cast<std::string>(nb::str(nb::object(array.attr("shape")))),
                       nb::cast<std::string>(nb::str(nb::object(array.attr("dtype")))));
}

/// What NumPy makes of a value; None if it makes nothing of it.
nb::object as_array(nb::handle value) {
    try {
        return nb::module_::import_("numpy").attr("asarray")(value);
    } catch (const nb::python_error& e) {
        if (!e.matches(PyExc_Exception)) throw;
        return nb::none();
    }
}

char dtype_kind(nb::handle array) {
    return nb::cast<std::string>(array.attr("dtype").attr("kind")).front();
}

/// The elements of an array of a known dtype and shape, one after the other.
template <class Number, class T>
std::vector<T> elements(nb::handle array, const char* dtype) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(Number) == 0);
    using Array = nb::ndarray<const Number, nb::c_contig, nb::device::cpu>;
    const auto numpy = nb::module_::import_("numpy");
    const auto numbers = nb::cast<Array>(numpy.attr("ascontiguousarray")(array, dtype));
    std::vector<T> all(numbers.size() * sizeof(Number) / sizeof(T));
    if (!all.empty())
        std::memcpy(static_cast<void*>(all.data()), numbers.data(), all.size() * sizeof(T));
    return all;
}

/// Rows of numbers, from an array or a sequence, which may also have them one after the other, as Mitsuba does.
template <class Number, class T>
std::vector<T> rows_of(nb::handle value, const SourceLocation& where) {
    constexpr size_t kColumns = sizeof(T) / sizeof(Number);
    constexpr bool kIsInteger = std::is_integral_v<Number>;
    const nb::object array = as_array(value);
    bool fits = false;
    if (!array.is_none()) {
        const auto shape = nb::cast<std::vector<size_t>>(array.attr("shape"));
        const char kind = dtype_kind(array);
        const bool is_empty = nb::cast<size_t>(array.attr("size")) == 0;
        fits = (kind == 'i' || kind == 'u' || (kind == 'f' && (!kIsInteger || is_empty))) &&
               ((shape.size() == 2 && shape[1] == kColumns) ||
                (shape.size() == 1 && shape[0] % kColumns == 0));
    }
    if (!fits)
        throw SceneError(where, fmt::format("expected an array of shape (N, {}) of {}, found {}",
                                            kColumns, kIsInteger ? "integers" : "numbers",
                                            array.is_none() ? "what NumPy makes no array of"
                                                            : described(array)));
    return elements<Number, T>(array, kIsInteger ? "int64" : "float32");
}

/// The parts of a mesh, by the names that dicts may give them: the first one is the one that they are written with.
struct MeshPart {
    const char* name;
    std::vector<std::string> others;
};
const std::vector<MeshPart>& mesh_parts() {
    static const std::vector<MeshPart> parts = {
        {"positions", {"vertices", "vertex_positions"}},
        {"triangles", {"faces"}},
        {"normals", {"vertex_normals"}},
        {"uvs", {"texcoords", "vertex_texcoords"}},
        {"second_uvs", {}},
        {"colors", {"vertex_color", "vertex_colors"}},
        {"alphas", {}},
    };
    return parts;
}

/// The part of a mesh with this name; nullptr if there is none.
const MeshPart* mesh_part(const std::string& name) {
    for (const MeshPart& part : mesh_parts())
        if (part.name == name ||
            std::find(part.others.begin(), part.others.end(), name) != part.others.end())
            return &part;
    return nullptr;
}

bool is_pixels(const std::string& name) {
    return name == "data" || name == "bitmap";
}

bool has_unit_normals(const MeshData& mesh) {
    for (const Vec3& n : mesh.normals)
        if (!(std::fabs(length2(n) - 1) < 1e-6f)) return false;
    return true;
}

MeshData mesh_of(nb::dict d, const SourceLocation& where) {
    MeshData mesh;
    std::vector<std::string> known = {"name", "face_normals"};
    std::set<std::string> given;
    for (const MeshPart& part : mesh_parts()) {
        known.emplace_back(part.name);
        known.insert(known.end(), part.others.begin(), part.others.end());
    }
    for (const auto& [key, value] : d) {
        const std::string name = nb::cast<std::string>(nb::str(key));
        const SourceLocation at{where.file.str() + "/" + name, 0};
        const MeshPart* part = mesh_part(name);
        const std::string_view canonical = part ? part->name : "";
        if (part && !given.emplace(canonical).second)
            throw SceneError(at, fmt::format("these are \"{}\", which are given twice", canonical));
        if (name == "name")
            mesh.name = nb::cast<std::string>(nb::str(value));
        else if (name == "face_normals")
            mesh.face_normals = nb::cast<bool>(nb::bool_(value));
        else if (canonical == "positions")
            mesh.positions = rows_of<float, Vec3>(value, at);
        else if (canonical == "normals")
            mesh.normals = rows_of<float, Vec3>(value, at);
        else if (canonical == "colors")
            mesh.colors = rows_of<float, Vec3>(value, at);
        else if (canonical == "alphas")
            mesh.alphas = rows_of<float, float>(value, at);
        else if (canonical == "uvs")
            mesh.uvs = rows_of<float, Vec2>(value, at);
        else if (canonical == "second_uvs")
            mesh.second_uvs = rows_of<float, Vec2>(value, at);
        else if (canonical == "triangles") {
            for (const auto& t : rows_of<int64_t, std::array<int64_t, 3>>(value, at)) {
                MeshData::Triangle triangle{};
                for (size_t i = 0; i < 3; ++i) {
                    if (t[i] < 0 || t[i] > int64_t(UINT32_MAX))
                        throw SceneError(at, fmt::format("{} is no number of a vertex", t[i]));
                    triangle[i] = uint32_t(t[i]);
                }
                mesh.triangles.push_back(triangle);
            }
        } else
            throw SceneError(at, fmt::format("a mesh has no {}{}", quote(name), hint(name, known)));
    }
    for (const char* needed : {"positions", "triangles"})
        if (!given.contains(needed))
            throw SceneError(where, fmt::format("the mesh has no {}: give \"{}\", or \"{}\"",
                                                needed, needed, mesh_part(needed)->others.front()));
    for (const auto& [name, count] : {std::pair{"normals", mesh.normals.size()},
                                      {"uvs", mesh.uvs.size()},
                                      {"second_uvs", mesh.second_uvs.size()},
                                      {"colors", mesh.colors.size()},
                                      {"alphas", mesh.alphas.size()}})
        if (count > 0 && count != mesh.positions.size())
            throw SceneError(where, fmt::format("there are {} {}, but {} positions", count, name,
                                                mesh.positions.size()));
    MeshData finished = mesh;
    finish_mesh(finished, {}, where);
    // The mesh of a description is finished already, and stays the same to the last bit.
    const bool is_finished = finished.triangles.size() == mesh.triangles.size() &&
                             finished.positions.size() == mesh.positions.size() &&
                             finished.normals.size() == mesh.normals.size() &&
                             has_unit_normals(mesh);
    return is_finished ? mesh : finished;
}

/// An image file with the pixels of an array: sRGB codes as they are, other numbers as linear values.
std::string image_file(nb::handle value, const SourceLocation& where) {
    const nb::object array = as_array(value);
    size_t height = 0, width = 0, channels = 0;
    char kind = 0;
    if (!array.is_none()) {
        const auto shape = nb::cast<std::vector<size_t>>(array.attr("shape"));
        const bool is_code =
            nb::cast<std::string>(nb::str(nb::object(array.attr("dtype")))) == "uint8";
        if (is_code || dtype_kind(array) == 'f') kind = is_code ? 'u' : 'f';
        if (shape.size() == 2) channels = 1;
        if (shape.size() == 3) channels = shape[2];
        if (channels > 0) height = shape[0], width = shape[1];
    }
    constexpr size_t kMost = 1 << 16;
    if (!kind || (channels != 1 && channels != 3) || height == 0 || width == 0 || height > kMost ||
        width > kMost)
        throw SceneError(
            where,
            fmt::format("expected an array of shape (H, W), (H, W, 1) or (H, W, 3), of uint8 "
                        "(sRGB) or of floats (linear), found {}{}",
                        array.is_none() ? "what NumPy makes no array of" : described(array),
                        channels == 4 ? " (give the alpha as an image of its own)" : ""));
    if (kind == 'u')
        return encode_png(int(width), int(height), elements<uint8_t, uint8_t>(array, "uint8"));
    const std::vector<float> pixels = elements<float, float>(array, "float32");
    for (size_t i = 0; i < pixels.size(); ++i)
        if (!std::isfinite(pixels[i]))
            throw SceneError(where, fmt::format("the pixel in row {} and column {} is not finite",
                                                i / channels / width, i / channels % width));
    // A portable float map, whose rows go up.
    std::string file = fmt::format("{}\n{} {}\n-1.0\n", channels == 3 ? "PF" : "Pf", width, height);
    const size_t row = width * channels;
    for (size_t y = height; y-- > 0;)
        file.append(reinterpret_cast<const char*>(pixels.data() + y * row), row * sizeof(float));
    return file;
}

EncodedImage encoded_image(nb::dict d, const SourceLocation& where) {
    const std::string name =
        d.contains("name") ? nb::cast<std::string>(nb::str(d["name"])) : where.file.str();
    std::string key;
    for (const auto& [given, value] : d) {
        const std::string other = nb::cast<std::string>(nb::str(given));
        if (!is_pixels(other)) continue;
        if (!key.empty())
            throw SceneError(where, fmt::format("give \"{}\" or \"{}\", not both", key, other));
        key = other;
    }
    if (!key.empty()) return {name, image_file(d[key.c_str()], {where.file.str() + "/" + key, 0})};
    if (!d.contains("bytes") || !nb::isinstance<nb::bytes>(d["bytes"]))
        throw SceneError(where,
                         "expected \"bytes\", the contents of an image file, or \"data\", an "
                         "array of pixels");
    const auto bytes = nb::borrow<nb::bytes>(d["bytes"]);
    return {name, std::string(bytes.c_str(), bytes.size())};
}

/// Puts a value in the place of the one of this index if no other object has that, or after the others. Returns the new
/// index.
template <class T>
int64_t put(const SceneDescription& scene, const SceneObject& object, const char* parameter,
            std::vector<Shared<T>>& values, T value) {
    const Param* old = object.find(parameter);
    const int64_t* index = old ? old->as<int64_t>() : nullptr;
    const auto has_it = [&](const SceneObject& o) {
        const Param* p = embedded_parameter(o) == parameter ? o.find(parameter) : nullptr;
        return p && p->as<int64_t>() && *p->as<int64_t>() == *index;
    };
    if (index && *index >= 0 && uint64_t(*index) < values.size() &&
        std::count_if(scene.objects.begin(), scene.objects.end(), has_it) == 1) {
        values[size_t(*index)] = std::move(value);
        return *index;
    }
    values.push_back(std::move(value));
    return int64_t(values.size()) - 1;
}

constexpr const char *kMesh = "mesh", *kImage = "image";

}  // namespace

const char* embedded_parameter(const SceneObject& object) {
    if (object.category == "shape" && object.type == "mesh") return kMesh;
    if (object.category == "texture" && object.type == "bitmap") return kImage;
    if (object.category == "emitter" && object.type == "envmap") return kImage;
    return nullptr;
}

bool is_embedded_part(const SceneObject& object, const std::string& name) {
    const char* const parameter = embedded_parameter(object);
    if (parameter == kMesh) return mesh_part(name) != nullptr;
    return parameter == kImage && is_pixels(name);
}

nb::object embedded_to_python(const SceneDescription& scene, const SceneObject& object,
                              const Param& param) {
    const int64_t* index = param.as<int64_t>();
    if (!index || *index < 0) return to_python(param.value);
    const char* const parameter = embedded_parameter(object);
    if (parameter == kMesh && uint64_t(*index) < scene.meshes.size())
        return to_python(scene.meshes[size_t(*index)]);
    if (parameter == kImage && uint64_t(*index) < scene.images.size()) {
        const EncodedImage& image = scene.images[size_t(*index)];
        nb::dict d;
        d["name"] = image.name;
        d["bytes"] = nb::bytes(image.bytes.data(), image.bytes.size());
        return d;
    }
    return to_python(param.value);
}

nb::object embedded_part(const SceneDescription& scene, const SceneObject& object,
                         const std::string& name) {
    const char* const parameter = embedded_parameter(object);
    const Param* mesh = parameter == kMesh ? object.find(kMesh) : nullptr;
    const MeshPart* part = mesh ? mesh_part(name) : nullptr;
    if (!part) return nb::none();
    const nb::object all = embedded_to_python(scene, object, *mesh);
    return nb::isinstance<nb::dict>(all) ? all.attr("get")(part->name) : nb::none();
}

nb::dict with_part(const SceneDescription& scene, const SceneObject& object,
                   const std::string& name, nb::handle value) {
    nb::dict all;
    const Param* mesh = embedded_parameter(object) == kMesh ? object.find(kMesh) : nullptr;
    if (mesh)
        if (const nb::object old = embedded_to_python(scene, object, *mesh);
            nb::isinstance<nb::dict>(old))
            all = nb::borrow<nb::dict>(old);
    if (const MeshPart* part = mesh ? mesh_part(name) : nullptr; part && all.contains(part->name))
        nb::del(all[part->name]);
    all[name.c_str()] = value;
    return all;
}

void embed(SceneDescription& scene, int index, nb::dict value, const SourceLocation& where) {
    SceneObject& object = scene.objects[size_t(index)];
    const char* const parameter = embedded_parameter(object);
    const int64_t number =
        parameter == kMesh ? put(scene, object, kMesh, scene.meshes, mesh_of(value, where))
                           : put(scene, object, kImage, scene.images, encoded_image(value, where));
    // What an image is read from is either in memory or a file.
    std::erase_if(object.params, [&](const Param& p) {
        return p.name == parameter || (parameter == kImage && p.name == "filename");
    });
    object.params.push_back({parameter, number, where});
}

}  // namespace etendue::python
