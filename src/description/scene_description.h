#pragma once
// The contents of a scene file as plain data: a flat list of objects with named parameters and children. Readers fill
// it, and only the scene builder interprets it. Names are those of Mitsuba 3 (snake_case), whatever the file's dialect.

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "color/rgb.h"
#include "description/mesh_data.h"
#include "description/shared.h"
#include "description/source_location.h"
#include "math/transform.h"
#include "math/vec.h"

namespace etendue {

/// Shared, so that the values of other parameters do not take its space.
using SharedTransform = Shared<Transform>;

/// Type of a `ParamValue`, in the order of its alternatives.
enum class ParamType { Bool, Int, Float, String, Vector, Rgb, Transform };
using ParamValue = std::variant<bool, int64_t, double, std::string, Vec3, Rgb, SharedTransform>;

/// Type and value, as in `float 0.5`.
std::string to_string(const ParamValue& value);

struct Param {
    std::string name;
    ParamValue value;
    SourceLocation where;

    ParamType type() const { return ParamType(value.index()); }
    /// The value if it has this type, otherwise nullptr.
    template <class T>
    const T* as() const {
        return std::get_if<T>(&value);
    }
};

template <>
inline const Transform* Param::as<Transform>() const {
    const SharedTransform* shared = std::get_if<SharedTransform>(&value);
    return shared ? &static_cast<const Transform&>(*shared) : nullptr;
}

/// One `<bsdf>`, `<shape>`, ... of the file.
struct SceneObject {
    /// integrator, sensor, sampler, film, rfilter, shape, bsdf, texture, emitter, medium
    std::string category;
    std::string type;  ///< The plug-in's name, e.g. "roughconductor".
    std::string id;    ///< Empty where the file gives none.
    SourceLocation where;
    std::vector<Param> params;
    struct Child {
        std::string
            name;    ///< Parameter name ("reflectance", "interior", ...); empty where unnamed.
        int object;  ///< Index into SceneDescription::objects; shared by all references to it.
        SourceLocation where;
    };
    std::vector<Child> children;

    const Param* find(std::string_view name) const;
};

/// An image file in memory.
struct EncodedImage {
    std::string name;  ///< For messages.
    std::string bytes;
};

/// What an image depends on is part of its fingerprint, see fingerprint.cpp.
struct SceneDescription {
    std::vector<SceneObject> objects;  ///< In any order; the graph of children has no cycles.
    std::vector<int> roots;            ///< The scene's own children, in file order.
    /// Meshes that the scene file holds itself, see shape `mesh`; not copied with the description.
    std::vector<Shared<MeshData>> meshes;
    /// Images that the scene file holds itself, see texture `bitmap` and emitter `envmap`.
    std::vector<Shared<EncodedImage>> images;
    std::string file;  ///< The scene file, as given.
    /// Directories in which relative file names are looked up, in order; the scene file's own comes first.
    std::vector<std::string> search_paths;
    /// What was dropped or replaced under `lenient`, one line each.
    std::vector<std::string> warnings;
    int left_out = 0;  ///< Number of things that were.
};

/// The candidate nearest to `name` by edit distance, whatever the case of letters; empty if none is near enough for a suggestion.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

/// Canonical text of a description (for golden tests): one line per object and parameter, sorted by parameter name,
/// without source locations.
std::string dump(const SceneDescription& scene);

}  // namespace etendue
