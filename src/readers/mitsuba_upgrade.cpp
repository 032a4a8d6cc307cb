#include "readers/mitsuba_upgrade.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "math/vec.h"

namespace etendue {
namespace {

bool is_lower(char c) {
    return c >= 'a' && c <= 'z';
}
bool is_upper(char c) {
    return c >= 'A' && c <= 'Z';
}

bool has(const SceneObject& object, std::string_view name) {
    return object.find(name) || std::any_of(object.children.begin(), object.children.end(),
                                            [&](const auto& child) { return child.name == name; });
}

/// Removes a parameter and returns it.
std::optional<Param> take(SceneObject& object, std::string_view name) {
    const auto it = std::find_if(object.params.begin(), object.params.end(),
                                 [&](const Param& p) { return p.name == name; });
    if (it == object.params.end()) return {};
    Param p = *it;
    object.params.erase(it);
    return p;
}

double number(const Param& p) {
    if (const auto* i = std::get_if<int64_t>(&p.value)) return double(*i);
    if (const auto* d = std::get_if<double>(&p.value)) return *d;
    throw SceneError(p.where, fmt::format("parameter \"{}\" must be a number, not {}", p.name,
                                          to_string(p.value)));
}

void rename(SceneObject& object, std::string_view from, const std::string& to) {
    if (has(object, to)) return;
    for (Param& p : object.params)
        if (p.name == from) p.name = to;
    for (auto& child : object.children)
        if (child.name == from) child.name = to;
}

void upgrade_uv(SceneObject& object) {
    const char* names[] = {"uscale", "vscale", "uoffset", "voffset"};
    double values[] = {1, 1, 0, 0};
    SourceLocation where;
    for (int i = 0; i < 4; ++i)
        if (const auto p = take(object, names[i])) {
            values[i] = number(*p);
            where = p->where;
        }
    if (where.file.empty()) return;
    const Transform to_uv(Transform::Matrix{
        {{values[0], 0, 0, values[2]}, {0, values[1], 0, values[3]}, {0, 0, 1, 0}, {0, 0, 0, 1}}});
    object.params.push_back({"to_uv", to_uv, where});
}

void upgrade_bitmap(SceneObject& object) {
    if (const auto gamma = take(object, "gamma")) {
        const double g = number(*gamma);
        if (g != 1 && g != -1)
            throw SceneError(
                gamma->where,
                fmt::format("gamma {} is not supported: use 1 (linear) or -1 (sRGB)", g));
        object.params.push_back({"raw", g == 1, gamma->where});
    }
    for (Param& p : object.params)
        if (auto* filter = std::get_if<std::string>(&p.value))
            if (p.name == "filter_type" && (*filter == "ewa" || *filter == "trilinear"))
                *filter = "bilinear";
    // Each direction may have its own mode instead of that of both.
    const auto both = take(object, "wrap_mode"), along_u = take(object, "wrap_mode_u"),
               along_v = take(object, "wrap_mode_v");
    const ParamValue repeat = std::string("repeat");
    const auto value = [&](const std::optional<Param>& own) {
        return own ? own->value : both ? both->value : repeat;
    };
    const SourceLocation where = both      ? both->where
                                 : along_u ? along_u->where
                                 : along_v ? along_v->where
                                           : SourceLocation{};
    if (both || along_u) object.params.push_back({"wrap_mode", value(along_u), where});
    if (!(value(along_v) == value(along_u)))
        object.params.push_back({"wrap_mode_v", value(along_v), where});
}

/// Rough diffuse: the α of Mitsuba 0.6 is an RMS slope, √2 times the standard deviation of the angle of [Oren & Nayar
/// 1994] in radians.
void upgrade_roughdiffuse(SceneObject& object) {
    object.type = "orennayar";
    take(object, "use_fast_approx");
    const auto alpha = take(object, "alpha");
    const double degrees = (alpha ? number(*alpha) : 0.2) / std::sqrt(2.0) * 180 / std::numbers::pi;
    object.params.push_back({"sigma", degrees, alpha ? alpha->where : object.where});
}

void upgrade_bsdf(SceneObject& object) {
    if (object.type == "bump") object.type = "bumpmap";
    if (object.type == "difftrans") {
        object.type = "diffusetransmission";
        object.params.push_back({"reflectance", Rgb(0), object.where});
        if (!has(object, "transmittance"))
            object.params.push_back({"transmittance", Rgb(0.5f), object.where});
    }
    if (object.type == "diffuse" || object.type == "roughdiffuse")
        rename(object, "diffuse_reflectance", "reflectance");
    if (object.type == "roughdiffuse") upgrade_roughdiffuse(object);
    const bool conductor = object.type == "conductor" || object.type == "roughconductor";
    if (conductor && !has(object, "material") && !has(object, "eta") && !has(object, "k"))
        object.params.push_back({"material", std::string("Cu"), object.where});
}

/// Mitsuba 0.6 has y up and z south for sky and sun; Mitsuba 3 has z up and x south.
void upgrade_daylight(SceneObject& object) {
    const Transform from_z_up(
        Transform::Matrix{{{0, -1, 0, 0}, {0, 0, 1, 0}, {1, 0, 0, 0}, {0, 0, 0, 1}}});
    for (Param& p : object.params)
        if (const auto* to_world = p.as<Transform>(); to_world && p.name == "to_world") {
            p.value = *to_world * from_z_up;
            return;
        }
    object.params.push_back({"to_world", from_z_up, object.where});
}

}  // namespace

std::string snake_case(std::string_view camel_case) {
    std::string snake;
    bool in_capitals = false;  // a run of capitals such as "IOR" is one word
    for (size_t i = 0; i < camel_case.size(); ++i) {
        const char c = camel_case[i];
        if (is_upper(c) && i > 0 && is_lower(camel_case[i - 1])) {
            snake += '_';
            in_capitals = true;
        }
        in_capitals = in_capitals && is_upper(c);
        snake += in_capitals ? char(c - 'A' + 'a') : c;
    }
    return snake;
}

void upgrade_object(SceneObject& object) {
    upgrade_uv(object);
    if (object.category == "bsdf") upgrade_bsdf(object);
    if (object.category == "texture" && object.type == "bitmap") upgrade_bitmap(object);
    if (object.category == "texture" && object.type == "vertexcolors")
        object.type = "mesh_attribute";
    if (object.category == "film" && object.type == "tiledhdrfilm") object.type = "hdrfilm";
    if (object.category == "emitter" &&
        (object.type == "sky" || object.type == "sun" || object.type == "sunsky"))
        upgrade_daylight(object);
}

}  // namespace etendue
