#include "embedded.h"

#include <cmath>
#include <cstring>

#include <fmt/format.h>
#include <nanobind/stl/string.h>

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

/// Rows of numbers, from an array or a sequence.
template <class Number, class T>
std::vector<T> rows_of(nb::handle value, const char* dtype, const SourceLocation& where) {
    constexpr size_t kColumns = sizeof(T) / sizeof(Number);
    using Array = nb::ndarray<const Number, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
    Array array;
    nb::object converted;
    try {
        converted = nb::module_::import_("numpy").attr("ascontiguousarray")(value, dtype);
        if (kColumns == 1) converted = converted.attr("reshape")(-1, 1);
        array = nb::cast<Array>(converted);
    } catch (const std::exception&) {
        throw SceneError(where,
                         fmt::format("expected an array of shape (N, {}) of {}", kColumns, dtype));
    }
    if (array.shape(1) != kColumns)
        throw SceneError(where,
                         fmt::format("expected an array of shape (N, {}), found one of shape "
                                     "({}, {})",
                                     kColumns, array.shape(0), array.shape(1)));
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) == kColumns * sizeof(Number));
    std::vector<T> rows(array.shape(0));
    if (!rows.empty())
        std::memcpy(static_cast<void*>(rows.data()), array.data(), rows.size() * sizeof(T));
    return rows;
}

bool has_unit_normals(const MeshData& mesh) {
    for (const Vec3& n : mesh.normals)
        if (!(std::fabs(length2(n) - 1) < 1e-6f)) return false;
    return true;
}

MeshData mesh_of(nb::dict d, const SourceLocation& where) {
    MeshData mesh;
    const std::vector<std::string> known = {"name",    "positions", "triangles",
                                            "normals", "uvs",       "second_uvs",
                                            "colors",  "alphas",    "face_normals"};
    for (const auto& [key, value] : d) {
        const std::string name = nb::cast<std::string>(nb::str(key));
        const SourceLocation at{where.file.str() + "/" + name, 0};
        if (name == "name")
            mesh.name = nb::cast<std::string>(nb::str(value));
        else if (name == "positions")
            mesh.positions = rows_of<float, Vec3>(value, "float32", at);
        else if (name == "normals")
            mesh.normals = rows_of<float, Vec3>(value, "float32", at);
        else if (name == "colors")
            mesh.colors = rows_of<float, Vec3>(value, "float32", at);
        else if (name == "alphas")
            mesh.alphas = rows_of<float, float>(value, "float32", at);
        else if (name == "uvs")
            mesh.uvs = rows_of<float, Vec2>(value, "float32", at);
        else if (name == "second_uvs")
            mesh.second_uvs = rows_of<float, Vec2>(value, "float32", at);
        else if (name == "face_normals")
            mesh.face_normals = nb::cast<bool>(nb::bool_(value));
        else if (name == "triangles") {
            for (const auto& t : rows_of<int64_t, std::array<int64_t, 3>>(value, "int64", at)) {
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

}  // namespace

const char* embedded_parameter(const SceneObject& object) {
    if (object.category == "shape" && object.type == "mesh") return "mesh";
    if (object.category == "texture" && object.type == "bitmap") return "image";
    return nullptr;
}

nb::object embedded_to_python(const SceneDescription& scene, const SceneObject& object,
                              const Param& param) {
    const int64_t* index = param.as<int64_t>();
    if (!index || *index < 0) return to_python(param.value);
    if (object.category == "shape" && uint64_t(*index) < scene.meshes.size())
        return to_python(scene.meshes[size_t(*index)]);
    if (object.category == "texture" && uint64_t(*index) < scene.images.size()) {
        const EncodedImage& image = scene.images[size_t(*index)];
        nb::dict d;
        d["name"] = image.name;
        d["bytes"] = nb::bytes(image.bytes.data(), image.bytes.size());
        return d;
    }
    return to_python(param.value);
}

int64_t add_embedded(SceneDescription& scene, const SceneObject& object, nb::dict value,
                     const SourceLocation& where) {
    if (object.category == "shape") {
        scene.meshes.push_back(mesh_of(value, where));
        return int64_t(scene.meshes.size()) - 1;
    }
    if (!value.contains("bytes") || !nb::isinstance<nb::bytes>(value["bytes"]))
        throw SceneError(where, "expected \"bytes\", the contents of an image file");
    const auto bytes = nb::borrow<nb::bytes>(value["bytes"]);
    scene.images.push_back(EncodedImage{
        value.contains("name") ? nb::cast<std::string>(nb::str(value["name"])) : where.file.str(),
        std::string(bytes.c_str(), bytes.size())});
    return int64_t(scene.images.size()) - 1;
}

}  // namespace etendue::python
