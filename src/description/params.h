#pragma once
// Typed access to the parameters of one scene object, and their check against the table of the plug-in. The check and
// `etendue list` use the same `PluginInfo`.

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "description/scene_description.h"

namespace etendue {

/// Kind of a plug-in's parameter. A Texture may be, and an Object is, a child of the object.
enum class ParamKind {
    Bool,
    Int,
    Float,
    String,
    Vector,  ///< point or vector
    Rgb,     ///< colour or spectrum; a number is taken as grey
    Transform,
    Texture,      ///< colour, spectrum, number or nested texture
    Object,       ///< nested bsdf, medium, film, ...
    FloatOrName,  ///< number, or a name that stands for one
};

struct ParamInfo {
    const char* name;
    ParamKind kind;
    const char*
        fallback;     ///< Default as printed; "" where it is required or has no single default.
    const char* doc;  ///< One sentence with unit and range.
    bool is_experimental = false;  ///< For comparisons with other methods and figures only.
};

/// The parameters of all tables, in order.
std::vector<ParamInfo> concat(std::initializer_list<std::vector<ParamInfo>> tables);

/// One plug-in of one category, as `etendue list` prints it and check_params() uses it.
struct PluginInfo {
    const char* category;
    const char* name;
    const char* doc;  ///< One sentence with its source.
    std::vector<ParamInfo> params;

    bool has_param(std::string_view param) const {
        return std::any_of(params.begin(), params.end(),
                           [&](const ParamInfo& p) { return param == p.name; });
    }
};

/// The parameters of `object`, by name. Every getter returns the default where the parameter is absent, and throws
/// SceneError where its type or value is invalid.
class Params {
public:
    Params(const SceneDescription& scene, int object) : scene_(&scene), index_(object) {}

    const SceneObject& object() const { return scene_->objects[index_]; }
    const SceneDescription& scene() const { return *scene_; }
    int index() const { return index_; }
    const SourceLocation& where() const { return object().where; }
    /// Location of the parameter or child `name`, or of the object where it has none.
    SourceLocation where(std::string_view name) const;

    bool has(std::string_view name) const;
    bool flag(std::string_view name, bool fallback) const;
    int64_t integer(std::string_view name, int64_t fallback, int64_t lo, int64_t hi) const;
    /// A finite number in [lo, hi].
    float number(std::string_view name, float fallback, float lo = -kInf, float hi = kInf) const;
    std::string text(std::string_view name, std::string_view fallback) const;
    /// Index of the parameter's text in `options`; throws SceneError, which lists them, where it is none of them.
    int choice(std::string_view name, std::initializer_list<const char*> options,
               int fallback) const;
    Vec3 vector(std::string_view name, Vec3 fallback) const;
    /// A colour whose components are finite and at least `lo`.
    Rgb rgb(std::string_view name, Rgb fallback, float lo = 0) const;
    /// An invertible transform; identity where absent.
    Transform transform(std::string_view name) const;

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

/// What is known of a parameter that the plug-in's table does not have.
struct ForeignParam {
    bool is_ignored;     ///< It is read without effect; otherwise it is refused.
    const char* reason;  ///< Why.
};

/// Checks that every parameter of `object` is in the table and has a suitable type. Calls `report` with location and
/// message for each one that has not; the caller throws or warns. `foreign` is asked for parameters that are not in
/// the table.
void check_params(
    const SceneDescription& scene, int object, const PluginInfo& info,
    const std::function<void(const SourceLocation&, const std::string&)>& report,
    const std::function<std::optional<ForeignParam>(const std::string& name)>& foreign = {});

/// Throws SceneError where a parameter that the table has is of another type.
void check_param_types(const SceneDescription& scene, int object, const PluginInfo& info);

/// "boolean", "float", ... as printed in messages and by `etendue list`.
const char* kind_name(ParamKind kind);

}  // namespace etendue
