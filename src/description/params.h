#pragma once
// Typed access to the parameters of one scene object, checked against the plug-in's table. What a model asks for, what
// the parser accepts and what `etendue list` prints come from the same `PluginInfo`.

#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "description/scene_description.h"

namespace etendue {

/// Kinds a plug-in's parameter may have; the last ones are children of the object.
enum class ParamKind {
    Bool,
    Int,
    Float,
    String,
    Vector,  ///< point or vector
    Rgb,     ///< colour or spectrum; a float is taken as grey
    Transform,
    Texture,      ///< colour, spectrum, float or nested texture
    Object,       ///< nested bsdf, medium, film, ...
    FloatOrName,  ///< number, or the name of one in a table
};

struct ParamInfo {
    const char* name;
    ParamKind kind;
    const char*
        fallback;  ///< Default as printed; "" where the parameter is required or has no single default.
    const char* doc;  ///< One sentence with unit and range.
};

/// One plug-in of one category: what `list` prints and what the parser checks.
struct PluginInfo {
    const char* category;
    const char* name;
    const char* doc;  ///< One sentence: what it is and its source.
    std::vector<ParamInfo> params;
};

/// The parameters of `object`, by name and type. Every getter throws SceneError where the type or the range does not
/// fit, and returns the default where the parameter is absent.
class Params {
public:
    Params(const SceneDescription& scene, int object) : scene_(&scene), index_(object) {}

    const SceneObject& object() const { return scene_->objects[index_]; }
    const SceneDescription& scene() const { return *scene_; }
    int index() const { return index_; }
    const SourceLocation& where() const { return object().where; }
    SourceLocation where(std::string_view name) const;

    bool has(std::string_view name) const;
    bool flag(std::string_view name, bool fallback) const;
    int64_t integer(std::string_view name, int64_t fallback, int64_t lo, int64_t hi) const;
    /// A number within [lo, hi]; must be finite.
    float number(std::string_view name, float fallback, float lo = -kInf, float hi = kInf) const;
    std::string text(std::string_view name, std::string_view fallback) const;
    /// Index of the parameter's text in `options`; an error that names them all where it is none of them.
    int choice(std::string_view name, std::initializer_list<const char*> options,
               int fallback) const;
    Vec3 vector(std::string_view name, Vec3 fallback) const;
    /// A colour whose components are finite and at least `lo`.
    Rgb rgb(std::string_view name, Rgb fallback, float lo = 0) const;
    Transform
    transform(std::string_view name) const;  ///< Identity where absent; must be invertible.

    /// Child given under this parameter name, if any.
    const SceneObject::Child* child(std::string_view name) const;
    /// Children of a category, in file order.
    std::vector<SceneObject::Child> children(std::string_view category) const;

    [[noreturn]] void fail(const std::string& message) const { throw SceneError(where(), message); }
    [[noreturn]] void fail(std::string_view name, const std::string& message) const {
        throw SceneError(where(name), message);
    }

private:
    template <class T>
    const T* get(std::string_view name, const char* expected) const;

    const SceneDescription* scene_;
    int index_;
};

/// Checks that every parameter of `object` is in the table and has a kind that fits. What is unknown goes to `report`
/// (location, message with the nearest known name); the caller throws or warns.
void check_params(const SceneDescription& scene, int object, const PluginInfo& info,
                  const std::function<void(const SourceLocation&, const std::string&)>& report);

/// "bool", "float", ... as printed in messages and by `list`.
const char* kind_name(ParamKind kind);

}  // namespace etendue
