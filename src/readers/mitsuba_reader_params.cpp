#include <algorithm>

#include <fmt/format.h>

#include "readers/mitsuba_reader.h"
#include "readers/mitsuba_transform.h"
#include "readers/mitsuba_upgrade.h"

namespace etendue {

const std::vector<MitsubaReader::Rule> MitsubaReader::kRules = {
    {"boolean", "name value", "", &MitsubaReader::read_boolean},
    {"integer", "name value", "", &MitsubaReader::read_integer},
    {"float", "name value", "", &MitsubaReader::read_float},
    {"string", "name value", "", &MitsubaReader::read_string},
    {"point", "name", "x y z value", &MitsubaReader::read_vector},
    {"vector", "name", "x y z value", &MitsubaReader::read_vector},
    {"rgb", "name value", "intent", &MitsubaReader::read_rgb},
    {"srgb", "name value", "", &MitsubaReader::read_srgb},
    {"blackbody", "name temperature", "scale", &MitsubaReader::read_blackbody},
    {"spectrum", "name", "value filename type intent id", &MitsubaReader::read_spectrum},
    {"transform", "name", "", &MitsubaReader::read_transform},
    {"default", "name value", "", &MitsubaReader::read_default},
    {"include", "filename", "name", &MitsubaReader::read_include},
    {"path", "value", "", &MitsubaReader::read_path},
    {"alias", "id as", "", &MitsubaReader::read_alias},
    {"ref", "id", "name", &MitsubaReader::read_ref},
};

const std::vector<MitsubaReader::Rule> MitsubaReader::kTransformSteps = {
    {"translate", "", "x y z value", nullptr},  {"rotate", "angle", "x y z value", nullptr},
    {"scale", "", "x y z value", nullptr},      {"matrix", "value", "", nullptr},
    {"lookat", "origin target", "up", nullptr}, {"lookAt", "origin target", "up", nullptr},
};

namespace {

/// Checks the attribute `intent`, which matters to spectral renderers only and is ignored here.
void check_intent(const Element& e) {
    const std::string* intent = e.find("intent");
    if (intent && *intent != "reflectance" && *intent != "illuminant")
        throw SceneError(e.where,
                         fmt::format("the intent must be \"reflectance\" or \"illuminant\", not {}",
                                     quote(*intent)));
}

/// Whether a spectrum of this type is a texture.
bool is_texture_type(std::string_view type) {
    constexpr std::string_view kTypes[] = {"bitmap", "checkerboard", "mesh_attribute", "volume"};
    return std::find(std::begin(kTypes), std::end(kTypes), type) != std::end(kTypes);
}

}  // namespace

void MitsubaReader::add_param(const Element& e, Scope& scope, ParamValue value) {
    if (scope.object < 0)
        throw SceneError(e.where,
                         fmt::format("parameter {} cannot stand in the <scene>", quote(e["name"])));
    scene_.objects[scope.object].params.push_back(
        {claim_name(e, scope), std::move(value), e.where});
}

void MitsubaReader::read_boolean(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    add_param(e, scope, parse_boolean(e["value"], e.where));
}

void MitsubaReader::read_integer(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    add_param(e, scope, parse_integer(e["value"], e.where));
}

void MitsubaReader::read_float(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    add_param(e, scope, parse_float(e["value"], e.where));
}

void MitsubaReader::read_string(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    add_param(e, scope, e["value"]);
}

void MitsubaReader::read_vector(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    if (!e.find("value"))
        for (const char* axis : {"x", "y", "z"})
            if (!e.find(axis))
                throw SceneError(e.where,
                                 fmt::format("<{}> needs the attribute \"{}\"", e.name, axis));
    add_param(e, scope, to_vec3(read_xyz(e, 0), e.where));
}

void MitsubaReader::read_rgb(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    check_intent(e);
    const std::vector<double> hex = parse_hex_colour(e["value"], e.where);
    Rgb colour;
    if (hex.empty())
        colour = to_rgb(parse_triple(e["value"], e.where), e.where);
    else if (source_->is_old())
        colour = to_rgb(hex, e.where);  // linear in Mitsuba 0.6, which decodes sRGB in <srgb> only
    else
        colour = parse_srgb(e["value"], e.where);
    add_param(e, scope, colour);
}

void MitsubaReader::read_srgb(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    add_param(e, scope, parse_srgb(e["value"], e.where));
}

void MitsubaReader::read_blackbody(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    std::string kelvin = e["temperature"];
    if (!kelvin.empty() && (kelvin.back() == 'K' || kelvin.back() == 'k')) kelvin.pop_back();
    SceneObject plugin{.category = "spectrum",
                       .type = "blackbody",
                       .id = {},
                       .where = e.where,
                       .params = {},
                       .children = {}};
    plugin.params.push_back({"temperature", parse_float(kelvin, e.where), e.where});
    if (const std::string* scale = e.find("scale"))
        plugin.params.push_back({"scale", parse_float(*scale, e.where), e.where});
    add_param(e, scope, spectrum_plugin_colour(plugin, SpectrumRole::Emission));
}

void MitsubaReader::read_spectrum(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_intent(e);
    const std::string *value = e.find("value"), *file = e.find("filename"), *type = e.find("type");
    if (!!value + !!file + !!type != 1)
        throw SceneError(
            e.where, "<spectrum> needs one of the attributes \"value\", \"filename\" and \"type\"");
    // In Mitsuba 2 and 3, textures are spectra that vary.
    if (type && is_texture_type(*type)) {
        Element texture = e;
        texture.name = "texture";
        return read_object(texture, node, scope);
    }
    const std::string name = source_->is_old() ? snake_case(e["name"]) : e["name"];
    const SpectrumRole role = spectrum_role(scope.category, name, scope.in_emitter);
    if (type) {
        add_param(e, scope, spectrum_from_plugin(e, node, scope, role));
        return;
    }
    check_leaf(node);
    if (value) {
        add_param(e, scope, spectrum_from_value(e, role));
        return;
    }
    std::string path;
    const std::string text = load(*file, e.where, path);
    add_param(e, scope, spectrum_colour(parse_spectrum_file(text, path), role));
}

Rgb MitsubaReader::spectrum_from_value(const Element& e, SpectrumRole role) const {
    const std::string& value = e["value"];
    if (value.find(':') != value.npos)
        return spectrum_colour(parse_spectrum_list(value, e.where), role);
    const std::vector<double> numbers = parse_floats(value, e.where);
    // A constant is grey in emitters too, a scaled D65, as in Mitsuba 0.6. Builds of Mitsuba 0.6 with three spectral
    // samples take three numbers as a colour.
    if (numbers.size() == 1 || (numbers.size() == 3 && source_->is_old()))
        return to_rgb(parse_triple(value, e.where), e.where);
    throw SceneError(
        e.where,
        fmt::format("expected one number or a list of wavelength:value, found {}", quote(value)));
}

Rgb MitsubaReader::spectrum_from_plugin(const Element& e, const pugi::xml_node& node,
                                        const Scope& scope, SpectrumRole role) {
    // The spectrum is read as a temporary object. It has no children, so it is still the last object afterwards.
    const int index = int(scene_.objects.size());
    scene_.objects.push_back({.category = "spectrum",
                              .type = e["type"],
                              .id = {},
                              .where = e.where,
                              .params = {},
                              .children = {}});
    Scope inner{index, "spectrum", scope.depth + 1, scope.in_emitter, {}};
    read_children(node, inner);
    const SceneObject plugin = std::move(scene_.objects.back());
    scene_.objects.pop_back();
    return spectrum_plugin_colour(plugin, role);
}

void MitsubaReader::read_transform(const Element& e, const pugi::xml_node& node, Scope& scope) {
    Transform transform;
    for (const pugi::xml_node& child : node.children()) {
        if (child.type() != pugi::node_element) fail_text(child);
        const auto rule =
            std::find_if(kTransformSteps.begin(), kTransformSteps.end(), [&](const Rule& r) {
                return std::string_view(r.element) == child.name();
            });
        if (rule == kTransformSteps.end()) {
            reject(locate(child), fmt::format("a <transform> cannot contain a <{}>", child.name()),
                   " (known: translate, rotate, scale, matrix, lookat)");
            continue;
        }
        check_leaf(child);
        transform = read_transform_step(open(child, rule->required, rule->optional)) * transform;
    }
    for (const auto& row : transform.matrix())
        for (double v : row)
            if (!std::isfinite(v))
                throw SceneError(
                    e.where, fmt::format("the transform has an entry that is not finite: {}", v));
    add_param(e, scope, transform);
}

}  // namespace etendue
