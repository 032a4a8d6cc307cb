#include "values.h"

#include <map>

#include <fmt/format.h>

#include "readers/mitsuba_spectrum.h"
#include "readers/mitsuba_values.h"
#include "render/scene_integrator.h"
#include "scene/builder.h"

namespace etendue::python {
namespace {

using Key = std::pair<std::string, std::string>;

const std::map<Key, PluginInfo>& plugins() {
    static const std::map<Key, PluginInfo> all = [] {
        std::map<Key, PluginInfo> by_name;
        for (const PluginInfo& p : scene_plugins()) by_name.emplace(Key{p.category, p.name}, p);
        for (const PluginInfo& p : scene_file_integrators())
            by_name.emplace(Key{p.category, p.name}, p);
        return by_name;
    }();
    return all;
}

bool is_text(nb::handle value) {
    return nb::isinstance<nb::str>(value);
}

/// Arrays without a dimension say that they are sequences, but have no length.
bool is_sequence(nb::handle value) {
    if (!PySequence_Check(value.ptr())) return false;
    if (PySequence_Size(value.ptr()) >= 0) return true;
    PyErr_Clear();
    return false;
}

/// Whether the value is a boolean of NumPy, or an array of one without a dimension.
bool is_numpy_bool(nb::handle value) {
    if (is_sequence(value) || !nb::hasattr(value, "dtype")) return false;
    const nb::object kind = nb::getattr(value.attr("dtype"), "kind", nb::none());
    return is_text(kind) && nb::cast<std::string>(kind) == "b";
}

/// Python's and NumPy's integers.
bool is_integer(nb::handle value) {
    if (!PyIndex_Check(value.ptr()) || is_sequence(value)) return false;
    if (const nb::object index = nb::steal(PyNumber_Index(value.ptr())); index.is_valid())
        return true;
    PyErr_Clear();
    return false;
}

std::optional<double> number(nb::handle value) {
    if (is_text(value) || is_sequence(value)) return {};
    const double v = PyFloat_AsDouble(value.ptr());
    if (v == -1 && PyErr_Occurred()) {
        PyErr_Clear();
        return {};
    }
    return v;
}

/// The numbers of a sequence or array, row by row where it has rows; empty for anything else.
std::vector<double> numbers(nb::handle value, size_t& rows, bool is_row = false) {
    std::vector<double> all;
    rows = 0;
    if (is_text(value) || !is_sequence(value)) return {};
    for (nb::handle item : nb::borrow<nb::sequence>(value)) {
        if (const auto v = number(item)) {
            all.push_back(*v);
            continue;
        }
        if (is_row) return {};
        size_t inner = 0;
        const std::vector<double> row = numbers(item, inner, true);
        if (row.empty()) return {};
        all.insert(all.end(), row.begin(), row.end());
        ++rows;
    }
    return all;
}

std::string text(nb::handle value) {
    return nb::cast<std::string>(value);
}

std::string printed(nb::handle value) {
    return text(nb::repr(value));
}

[[noreturn]] void refuse(nb::handle value, const ValueContext& c, const char* expected) {
    throw SceneError(c.where,
                     fmt::format("expected {}, found {}", expected, quote(printed(value))));
}

Rgb rgb_value(nb::handle value, const ValueContext& c) {
    if (const auto v = number(value)) return to_rgb({*v, *v, *v}, c.where);
    if (is_text(value)) return parse_srgb(text(value), c.where);
    size_t rows = 0;
    const std::vector<double> v = numbers(value, rows);
    if (v.size() != 3 || rows > 0) refuse(value, c, "a number, three numbers or \"#rrggbb\"");
    return to_rgb(v, c.where);
}

Rgb spectrum_value(nb::handle value, const ValueContext& c) {
    const SpectrumRole role = spectrum_role(c.category, c.parameter, c.in_emitter);
    if (const auto v = number(value)) return to_rgb({*v, *v, *v}, c.where);
    if (is_text(value)) return spectrum_colour(parse_spectrum_list(text(value), c.where), role);
    size_t rows = 0;
    const std::vector<double> v = numbers(value, rows);
    if (rows == 0 || v.size() != 2 * rows)
        refuse(value, c, "a number, or a list of (wavelength, value)");
    SpectrumSamples samples;
    for (size_t i = 0; i < rows; ++i) {
        samples.wavelengths.push_back(v[2 * i]);
        samples.values.push_back(v[2 * i + 1]);
    }
    check_samples(samples, c.where);
    return spectrum_colour(samples, role);
}

/// A spectrum plug-in, such as {"type": "blackbody", "temperature": 3000}.
Rgb spectrum_plugin(const std::string& type, nb::dict d, const ValueContext& c) {
    SceneObject object{.category = "spectrum",
                       .type = type,
                       .id = {},
                       .where = c.where,
                       .params = {},
                       .children = {}};
    for (const auto& [key, value] : d) {
        const std::string name = text(key);
        if (name == "type") continue;
        ValueContext inner = c;
        inner.parameter = name;
        inner.kind = name == "color" ? std::optional(ParamKind::Rgb) : std::nullopt;
        object.params.push_back({name, to_value(value, inner), c.where});
    }
    return spectrum_plugin_colour(object, spectrum_role(c.category, c.parameter, c.in_emitter));
}

constexpr const char* kSpectra[] = {"rgb", "spectrum",  "blackbody", "uniform",
                                    "d65", "irregular", "regular",   "srgb"};

ParamValue value_of_dict(nb::dict d, const ValueContext& c) {
    const std::string type = text(d["type"]);
    if (type != "rgb" && type != "spectrum") return spectrum_plugin(type, d, c);
    for (const auto& [key, value] : d)
        if (!is_text(key))
            throw SceneError(c.where, fmt::format("names of parameters of colour \"{}\" are "
                                                  "texts, not {}",
                                                  type, nb::repr(key).c_str()));
    for (const auto& [key, value] : d)
        if (text(key) != "type" && text(key) != "value")
            throw SceneError(c.where,
                             fmt::format("{} \"{}\" has no parameter \"{}\" (it has: value)",
                                         "colour", type, text(key)));
    if (!d.contains("value"))
        throw SceneError(c.where, fmt::format("colour \"{}\" needs the parameter \"value\"", type));
    return type == "rgb" ? rgb_value(d["value"], c) : spectrum_value(d["value"], c);
}

Transform matrix(const std::vector<double>& v) {
    Transform::Matrix m{};
    for (size_t i = 0; i < 16; ++i) m[i / 4][i % 4] = v[i];
    return Transform(m);
}

}  // namespace

const PluginInfo* find_plugin(const std::string& category, const std::string& type) {
    const auto found = plugins().find({category, type});
    return found == plugins().end() ? nullptr : &found->second;
}

std::string category_of(const std::string& type, const SourceLocation& where) {
    std::vector<std::string> known;
    for (const auto& [key, info] : plugins()) {
        if (key.second == type) return key.first;
        known.push_back(key.second);
    }
    throw SceneError(where, fmt::format("unknown plug-in {}{}", quote(type), hint(type, known)));
}

bool is_value(nb::handle value) {
    if (!nb::isinstance<nb::dict>(value)) return true;
    const auto d = nb::borrow<nb::dict>(value);
    if (!d.contains("type") || !is_text(d["type"])) return false;
    const std::string type = text(d["type"]);
    return std::find(std::begin(kSpectra), std::end(kSpectra), type) != std::end(kSpectra);
}

ParamValue to_value(nb::handle value, const ValueContext& c) {
    const bool is_colour = c.kind == ParamKind::Rgb || c.kind == ParamKind::Texture;
    const bool is_real =
        is_colour || c.kind == ParamKind::Float || c.kind == ParamKind::FloatOrName;
    if (nb::isinstance<nb::dict>(value)) return value_of_dict(nb::borrow<nb::dict>(value), c);
    if (nb::isinstance<nb::bool_>(value)) return nb::cast<bool>(value);
    if (is_numpy_bool(value)) return nb::cast<bool>(nb::bool_(value));
    if (is_text(value)) {
        if (is_colour) return parse_srgb(text(value), c.where);
        return text(value);
    }
    if (is_integer(value) && !is_real) {
        const int64_t v = PyLong_AsLongLong(nb::steal(PyNumber_Index(value.ptr())).ptr());
        if (v == -1 && PyErr_Occurred()) {
            PyErr_Clear();
            refuse(value, c, "an integer of at most 64 bits");
        }
        return v;
    }
    if (const auto v = number(value)) return *v;
    if (nb::hasattr(value, "__fspath__")) return text(nb::str(value));
    constexpr const char* kExpected = "a number, a text, three numbers, or a 4x4 matrix";
    if (PyBytes_Check(value.ptr()) || PyByteArray_Check(value.ptr())) refuse(value, c, kExpected);
    size_t rows = 0;
    const std::vector<double> v = numbers(value, rows);
    if (v.size() == 16 && rows == 4) return matrix(v);
    if (v.size() != 3 || rows > 0) refuse(value, c, kExpected);
    if (is_colour) return to_rgb(v, c.where);
    return to_vec3(v, c.where);
}

namespace {

struct Printer {
    nb::object operator()(bool v) const { return nb::bool_(v); }
    nb::object operator()(int64_t v) const { return nb::int_(v); }
    nb::object operator()(double v) const { return nb::float_(v); }
    nb::object operator()(const std::string& v) const { return nb::str(v.c_str(), v.size()); }
    nb::object operator()(Vec3 v) const { return list({v.x, v.y, v.z}); }
    nb::object operator()(Rgb v) const {
        nb::dict d;
        d["type"] = "rgb";
        d["value"] = list({v.r, v.g, v.b});
        return d;
    }
    nb::object operator()(const Transform& t) const {
        nb::list all;
        for (const auto& row : t.matrix()) all.append(list({row[0], row[1], row[2], row[3]}));
        return all;
    }
    static nb::list list(std::initializer_list<double> v) {
        nb::list all;
        for (const double x : v) all.append(x);
        return all;
    }
};

}  // namespace

nb::object to_python(const ParamValue& value) {
    return std::visit(Printer{}, value);
}

void check_above_0(const char* names, std::initializer_list<std::optional<double>> values) {
    for (const std::optional<double>& v : values)
        if (v && !(*v > 0)) throw nb::value_error(fmt::format("{} must be above 0", names).c_str());
}

int checked(const char* name, int value, int low, int high) {
    if (value >= low && value <= high) return value;
    throw nb::value_error(
        fmt::format("{} must lie between {} and {}, but is {}", name, low, high, value).c_str());
}

}  // namespace etendue::python
