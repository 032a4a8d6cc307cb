#include "readers/pbrt_arguments.h"

#include <algorithm>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"

namespace etendue {
namespace {

struct TypeName {
    std::string_view name;
    PbrtType type;
};
constexpr TypeName kTypes[] = {
    {"float", PbrtType::Float},         {"integer", PbrtType::Integer},
    {"string", PbrtType::String},       {"rgb", PbrtType::Rgb},
    {"texture", PbrtType::Texture},     {"bool", PbrtType::Bool},
    {"spectrum", PbrtType::Spectrum},   {"color", PbrtType::Rgb},
    {"point3", PbrtType::Vector},       {"point", PbrtType::Vector},
    {"point2", PbrtType::Point2},       {"normal", PbrtType::Vector},
    {"normal3", PbrtType::Vector},      {"vector3", PbrtType::Vector},
    {"vector", PbrtType::Vector},       {"vector2", PbrtType::Point2},
    {"blackbody", PbrtType::Blackbody}, {"xyz", PbrtType::Xyz},
};

/// Type and name of a declaration such as "point3 P".
void read_declaration(PbrtTokenizer& in, PbrtValue& value) {
    const std::string_view text = in.string();
    value.where = in.where();
    const size_t begin = text.find_first_not_of(" \t");
    const size_t end = std::min(text.find_first_of(" \t", begin), text.size());
    const size_t name = text.find_first_not_of(" \t", end);
    if (begin == text.npos || name == text.npos)
        in.fail(
            fmt::format("expected a parameter such as \"float radius\", found {}", quote(text)));
    const std::string_view type = text.substr(begin, end - begin);
    const auto known = std::find_if(std::begin(kTypes), std::end(kTypes),
                                    [&](const TypeName& t) { return type == t.name; });
    if (known == std::end(kTypes)) {
        std::vector<std::string> names;
        for (const TypeName& t : kTypes) names.emplace_back(t.name);
        in.fail(fmt::format("unknown type of parameter {}{}", quote(type), hint(type, names)));
    }
    value.type = known->type;
    if (value.type == PbrtType::Rgb || value.type == PbrtType::Vector) value.numbers.reserve(3);
    const std::string_view rest = text.substr(name);
    value.name = unescape(rest.substr(0, rest.find_last_not_of(" \t") + 1));
}

void read_item(PbrtTokenizer& in, PbrtValue& value) {
    switch (value.type) {
    case PbrtType::Integer: value.integers.push_back(in.number<int>("an integer")); break;
    case PbrtType::Bool: {
        const std::string_view word = in.peek() == '"' ? in.string() : in.word();
        if (word != "true" && word != "false")
            in.fail(fmt::format("expected true or false, found {}", quote(word)));
        value.integers.push_back(word == "true");
        break;
    }
    case PbrtType::String:
    case PbrtType::Texture: value.strings.push_back(unescape(in.string())); break;
    case PbrtType::Spectrum:
        if (in.peek() == '"') {
            value.strings.push_back(unescape(in.string()));
            break;
        }
        [[fallthrough]];
    default: value.numbers.push_back(in.number<float>("a number"));
    }
}

bool fits(PbrtType type, ParamKind kind) {
    switch (kind) {
    case ParamKind::Bool: return type == PbrtType::Bool;
    case ParamKind::Int: return type == PbrtType::Integer;
    case ParamKind::Float: return type == PbrtType::Float;
    case ParamKind::String: return type == PbrtType::String;
    case ParamKind::Vector:
        return type == PbrtType::Vector || type == PbrtType::Point2 || type == PbrtType::Float;
    case ParamKind::Rgb:
        return type == PbrtType::Rgb || type == PbrtType::Xyz || type == PbrtType::Blackbody ||
               type == PbrtType::Spectrum;
    case ParamKind::Texture:
        return type == PbrtType::Texture || type == PbrtType::Float || fits(type, ParamKind::Rgb);
    case ParamKind::FloatOrName: return type == PbrtType::Float || type == PbrtType::Spectrum;
    default: return false;
    }
}

std::string_view type_name(PbrtType type) {
    for (const TypeName& t : kTypes)
        if (t.type == type) return t.name;
    return "";
}

const char* wanted(ParamKind kind) {
    switch (kind) {
    case ParamKind::Int: return "an integer";
    case ParamKind::Vector: return "points, vectors or floats";
    case ParamKind::Rgb: return "an rgb, spectrum or blackbody";
    case ParamKind::Texture: return "a texture, float, rgb or spectrum";
    case ParamKind::FloatOrName: return "a float or a spectrum";
    case ParamKind::Bool: return "a bool";
    case ParamKind::Float: return "a float";
    default: return "a string";
    }
}

}  // namespace

std::vector<PbrtValue> read_pbrt_values(PbrtTokenizer& in) {
    std::vector<PbrtValue> values;
    while (in.peek() == '"') {
        if (values.empty()) values.reserve(4);
        PbrtValue& value = values.emplace_back();
        read_declaration(in, value);
        if (values.size() > kMostPbrtValues)
            throw SceneError(value.where,
                             fmt::format("more than {} parameters stand here", kMostPbrtValues));
        if (in.skip('[')) {
            while (!in.skip(']')) {
                if (!in.peek())
                    throw SceneError(value.where, "a list begins here that has no closing bracket");
                read_item(in, value);
            }
        } else {
            read_item(in, value);
        }
    }
    return values;
}

void PbrtArguments::check(const PbrtEntry& entry, PbrtVersion version,
                          const std::function<void(const SourceLocation&, const std::string&,
                                                   const std::string&)>& reject) {
    size_t kept = 0;
    for (PbrtValue& v : values_) {
        const auto info =
            std::find_if(entry.params.begin(), entry.params.end(), [&](const PbrtParamInfo& p) {
                return v.name == p.name && (p.versions & int(version));
            });
        const bool is_known = info != entry.params.end();
        // Colours of float textures are numbers.
        const ParamKind kind = !is_known ? ParamKind::Object
                               : info->kind == ParamKind::Rgb && kind_ == "float Texture"
                                   ? ParamKind::Float
                                   : info->kind;
        if (v.is_default && !fits(v.type, kind)) continue;
        if (!is_known) {
            std::vector<std::string> known;
            for (const PbrtParamInfo& p : entry.params)
                if (p.versions & int(version)) known.emplace_back(p.name);
            reject(v.where,
                   fmt::format("{} {} has no parameter {}", kind_, quote(name_), quote(v.name)),
                   hint(v.name, known));
            continue;
        }
        if (!fits(v.type, kind))
            throw SceneError(
                v.where, fmt::format("parameter \"{}\" of {} {} must be {}, not of type {}", v.name,
                                     kind_, quote(name_), wanted(kind), type_name(v.type)));
        if (v.size() == 0)
            throw SceneError(v.where, fmt::format("parameter \"{}\" has no value", v.name));
        if (std::any_of(values_.begin(), values_.begin() + ptrdiff_t(kept),
                        [&](const PbrtValue& k) { return k.name == v.name; }))
            throw SceneError(v.where, fmt::format("parameter \"{}\" is given twice", v.name));
        if (&v != &values_[kept]) values_[kept] = std::move(v);
        ++kept;
    }
    values_.erase(values_.begin() + ptrdiff_t(kept), values_.end());
}

void PbrtArguments::add_defaults(const std::vector<PbrtValue>& values) {
    for (const PbrtValue& v : values)
        if (!has(v.name)) values_.emplace_back(v).is_default = true;
}

const PbrtValue* PbrtArguments::find(std::string_view name) const {
    const auto it = std::find_if(values_.begin(), values_.end(),
                                 [&](const PbrtValue& v) { return v.name == name; });
    return it == values_.end() ? nullptr : &*it;
}

const PbrtValue* PbrtArguments::find_one(std::string_view name) const {
    const PbrtValue* v = find(name);
    if (v && v->size() != 1)
        fail(name, fmt::format("parameter \"{}\" must be one value, but has {}", name, v->size()));
    return v;
}

bool PbrtArguments::flag(std::string_view name, bool fallback) const {
    const PbrtValue* v = find_one(name);
    return v ? v->integers[0] != 0 : fallback;
}

int PbrtArguments::integer(std::string_view name, int fallback, int lo, int hi) const {
    const PbrtValue* v = find_one(name);
    if (!v) return fallback;
    if (v->integers[0] < lo || v->integers[0] > hi)
        fail(name, fmt::format("parameter \"{}\" is {}, but must lie between {} and {}", name,
                               v->integers[0], lo, hi));
    return v->integers[0];
}

float PbrtArguments::number(std::string_view name, float fallback, float lo, float hi) const {
    const PbrtValue* v = find_one(name);
    if (!v) return fallback;
    if (v->numbers.empty())
        fail(name, fmt::format("parameter \"{}\" must be a float here, not of type {}", name,
                               type_name(v->type)));
    const float x = v->numbers[0];
    if (!(x >= lo && x <= hi))
        fail(name, hi == kInf
                       ? fmt::format("parameter \"{}\" is {}, but must be at least {}", name, x, lo)
                       : fmt::format("parameter \"{}\" is {}, but must lie between {} and {}", name,
                                     x, lo, hi));
    return x;
}

std::string PbrtArguments::text(std::string_view name, std::string_view fallback) const {
    const PbrtValue* v = find_one(name);
    return v ? v->strings[0] : std::string(fallback);
}

Vec3 PbrtArguments::vector(std::string_view name, Vec3 fallback) const {
    const PbrtValue* v = find(name);
    if (!v) return fallback;
    if (v->numbers.size() != 3)
        fail(name, fmt::format("parameter \"{}\" must be three numbers, but has {}", name,
                               v->numbers.size()));
    return {v->numbers[0], v->numbers[1], v->numbers[2]};
}

const std::vector<float>& PbrtArguments::numbers(std::string_view name, size_t group) const {
    static const std::vector<float> kNone;
    const PbrtValue* v = find(name);
    if (!v) return kNone;
    if (v->numbers.size() % group != 0)
        fail(name, fmt::format("parameter \"{}\" has {} numbers, which is not a multiple of {}",
                               name, v->numbers.size(), group));
    return v->numbers;
}

const std::vector<int>& PbrtArguments::integers(std::string_view name) const {
    static const std::vector<int> kNone;
    const PbrtValue* v = find(name);
    return v ? v->integers : kNone;
}

void PbrtArguments::fail(const std::string& message) const {
    throw SceneError(where_, message);
}

void PbrtArguments::fail(std::string_view name, const std::string& message) const {
    const PbrtValue* v = find(name);
    throw SceneError(v ? v->where : where_, message);
}

}  // namespace etendue
