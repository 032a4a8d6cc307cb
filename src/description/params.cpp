#include "description/params.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace etendue {
namespace {

constexpr const char* kTypeNames[] = {"boolean", "integer", "float",    "string",
                                      "vector",  "colour",  "transform"};

/// "an integer", "a float", ...
std::string with_article(std::string_view noun) {
    return fmt::format("{} {}", noun.find_first_of("aeiou") == 0 ? "an" : "a", noun);
}

std::string type_name(const Param& p) {
    return with_article(kTypeNames[int(p.type())]);
}

bool accepts(ParamKind kind, ParamType type) {
    switch (kind) {
    case ParamKind::Bool: return type == ParamType::Bool;
    case ParamKind::Int: return type == ParamType::Int;
    case ParamKind::Float: return type == ParamType::Float || type == ParamType::Int;
    case ParamKind::String: return type == ParamType::String;
    case ParamKind::Vector: return type == ParamType::Vector;
    case ParamKind::Rgb:
    case ParamKind::Texture:
        return type == ParamType::Rgb || type == ParamType::Float || type == ParamType::Int;
    case ParamKind::Transform: return type == ParamType::Transform;
    case ParamKind::Object: return false;
    case ParamKind::FloatOrName:
        return type == ParamType::Float || type == ParamType::Int || type == ParamType::String;
    }
    return false;
}

}  // namespace

std::vector<ParamInfo> concat(std::initializer_list<std::vector<ParamInfo>> tables) {
    std::vector<ParamInfo> all;
    for (const auto& table : tables) all.insert(all.end(), table.begin(), table.end());
    return all;
}

const char* kind_name(ParamKind kind) {
    constexpr const char* names[] = {"boolean", "integer",   "float",   "string", "vector",
                                     "colour",  "transform", "texture", "object", "number or name"};
    return names[int(kind)];
}

SourceLocation Params::where(std::string_view name) const {
    if (const Param* p = object().find(name)) return p->where;
    if (const auto* c = child(name)) return c->where;
    return object().where;
}

bool Params::has(std::string_view name) const {
    return object().find(name) || child(name);
}

template <class T>
const T* Params::get(std::string_view name, const char* expected) const {
    const Param* p = object().find(name);
    if (!p) return nullptr;
    const T* v = p->as<T>();
    if (!v)
        throw SceneError(p->where,
                         fmt::format("parameter \"{}\" of {} \"{}\" must be {}, but is {}", name,
                                     object().category, object().type, with_article(expected),
                                     type_name(*p)));
    return v;
}

bool Params::flag(std::string_view name, bool fallback) const {
    const bool* v = get<bool>(name, "boolean");
    return v ? *v : fallback;
}

int64_t Params::integer(std::string_view name, int64_t fallback, int64_t lo, int64_t hi) const {
    const int64_t* v = get<int64_t>(name, "integer");
    if (v && (*v < lo || *v > hi))
        fail(name,
             fmt::format("parameter \"{}\" is {}, but must lie in [{}, {}]", name, *v, lo, hi));
    return v ? *v : fallback;
}

float Params::number(std::string_view name, float fallback, float lo, float hi) const {
    const Param* p = object().find(name);
    double v = fallback;
    if (p && p->type() == ParamType::Int)
        v = double(std::get<int64_t>(p->value));
    else if (const double* d = get<double>(name, "float"))
        v = *d;
    if (p && std::isfinite(v) && !std::isfinite(float(v)))
        fail(name, fmt::format("parameter \"{}\" is {}, which is out of range for single precision",
                               name, v));
    if (p && !(std::isfinite(v) && v >= lo && v <= hi))
        fail(name, std::isinf(lo) && std::isinf(hi)
                       ? fmt::format("parameter \"{}\" is {}, but must be finite", name, v)
                   : std::isinf(hi)
                       ? fmt::format("parameter \"{}\" is {}, but must be at least {}", name, v, lo)
                       : fmt::format("parameter \"{}\" is {}, but must lie in [{}, {}]", name, v,
                                     lo, hi));
    return float(v);
}

std::string Params::text(std::string_view name, std::string_view fallback) const {
    const std::string* v = get<std::string>(name, "string");
    return v ? *v : std::string(fallback);
}

int Params::choice(std::string_view name, std::initializer_list<const char*> options,
                   int fallback) const {
    const std::string* v = get<std::string>(name, "string");
    if (!v) return fallback;
    const auto it =
        std::find_if(options.begin(), options.end(), [&](const char* o) { return *v == o; });
    if (it == options.end())
        fail(name, fmt::format("parameter \"{}\" is \"{}\", but must be one of: {}", name, *v,
                               fmt::join(options.begin(), options.end(), ", ")));
    return int(it - options.begin());
}

Vec3 Params::vector(std::string_view name, Vec3 fallback) const {
    const Vec3* v = get<Vec3>(name, "vector");
    if (v && !is_finite(*v))
        fail(name, fmt::format("parameter \"{}\" is ({}, {}, {}), but must be finite", name, v->x,
                               v->y, v->z));
    return v ? *v : fallback;
}

Rgb Params::rgb(std::string_view name, Rgb fallback, float lo) const {
    const Param* p = object().find(name);
    if (!p) return fallback;
    Rgb c;
    if (p->type() == ParamType::Int)
        c = Rgb(float(std::get<int64_t>(p->value)));
    else if (p->type() == ParamType::Float)
        c = Rgb(float(std::get<double>(p->value)));
    else
        c = *get<Rgb>(name, "colour");
    if (!is_finite(c) || std::min({c.r, c.g, c.b}) < lo)
        fail(name, fmt::format("parameter \"{}\" is ({}, {}, {}), but its components must be "
                               "finite and at least {}",
                               name, c.r, c.g, c.b, lo));
    return c;
}

Transform Params::transform(std::string_view name) const {
    const Transform* t = get<Transform>(name, "transform");
    if (t && !t->is_invertible()) fail(name, fmt::format("transform \"{}\" is singular", name));
    if (t)
        for (const auto& row : t->matrix())
            for (const double v : row)
                if (!std::isfinite(float(v)))
                    fail(name, fmt::format("transform \"{}\" has the entry {}, which is out of "
                                           "range for single precision",
                                           name, v));
    return t ? *t : Transform();
}

const SceneObject::Child* Params::child(std::string_view name) const {
    for (const auto& c : object().children)
        if (c.name == name) return &c;
    return nullptr;
}

std::vector<SceneObject::Child> Params::children(std::string_view category) const {
    std::vector<SceneObject::Child> found;
    for (const auto& c : object().children)
        if (scene_->objects[c.object].category == category) found.push_back(c);
    return found;
}

void check_params(
    const SceneDescription& scene, int index, const PluginInfo& info,
    const std::function<void(const SourceLocation&, const std::string&)>& report,
    const std::function<std::optional<ForeignParam>(const std::string& name)>& foreign) {
    const SceneObject& object = scene.objects[index];
    std::vector<std::string> known;
    for (const ParamInfo& p : info.params) known.push_back(p.name);
    auto find = [&](const std::string& name) {
        return std::find_if(info.params.begin(), info.params.end(),
                            [&](const ParamInfo& p) { return name == p.name; });
    };
    auto unknown = [&](const SourceLocation& where, const std::string& name) {
        if (const auto known_elsewhere = foreign ? foreign(name) : std::nullopt) {
            if (!known_elsewhere->is_ignored)
                report(where, fmt::format("parameter \"{}\" of {} \"{}\" is not supported: {}",
                                          name, info.category, info.name, known_elsewhere->reason));
            return;
        }
        const std::string near = nearest_name(name, known);
        report(where,
               fmt::format("{} \"{}\" has no parameter \"{}\"{}", info.category, info.name, name,
                           !near.empty()   ? fmt::format(" (did you mean \"{}\"?)", near)
                           : known.empty() ? std::string(" (it has none)")
                                           : fmt::format(" (it has: {})", fmt::join(known, ", "))));
    };
    for (const Param& p : object.params) {
        const auto it = find(p.name);
        if (it == info.params.end())
            unknown(p.where, p.name);
        else if (!accepts(it->kind, p.type()))
            report(p.where, fmt::format("parameter \"{}\" of {} \"{}\" must be {}, but is {}",
                                        p.name, info.category, info.name,
                                        with_article(kind_name(it->kind)), type_name(p)));
    }
    for (const auto& c : object.children) {
        if (c.name.empty()) continue;
        const std::string& category = scene.objects[c.object].category;
        const bool is_texture = category == "texture";
        const auto it = find(c.name);
        if (it == info.params.end()) {
            if (is_texture) unknown(c.where, c.name);
        } else if (it->kind != ParamKind::Object &&
                   !(is_texture && it->kind == ParamKind::Texture)) {
            report(c.where, fmt::format("parameter \"{}\" of {} \"{}\" must be {}, but is {}",
                                        c.name, info.category, info.name,
                                        with_article(kind_name(it->kind)), with_article(category)));
        }
    }
}

void check_param_types(const SceneDescription& scene, int index, const PluginInfo& info) {
    for (const Param& p : scene.objects[size_t(index)].params)
        for (const ParamInfo& known : info.params)
            if (p.name == known.name && !accepts(known.kind, p.type()))
                throw SceneError(p.where,
                                 fmt::format("parameter \"{}\" of {} \"{}\" must be {}, but is {}",
                                             p.name, info.category, info.name,
                                             with_article(kind_name(known.kind)), type_name(p)));
}

}  // namespace etendue
