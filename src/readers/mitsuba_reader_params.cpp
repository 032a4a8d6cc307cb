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
    const SpectrumOfRole colour = type    ? spectrum_from_plugin(e, node, scope)
                                  : value ? spectrum_from_value(e, node)
                                          : spectrum_from_file(e, node);
    add_param(e, scope, colour(spectrum_role(scope.category, name, scope.in_emitter)));
    if (scope.category == "texture") texture_spectra_.push_back({scope.object, name, colour});
}

MitsubaReader::SpectrumOfRole MitsubaReader::spectrum_from_file(const Element& e,
                                                                const pugi::xml_node& node) {
    check_leaf(node);
    std::string path;
    const std::string text = load(e["filename"], e.where, path);
    return [samples = parse_spectrum_file(text, path)](SpectrumRole role) {
        return spectrum_colour(samples, role);
    };
}

MitsubaReader::SpectrumOfRole MitsubaReader::spectrum_from_value(const Element& e,
                                                                 const pugi::xml_node& node) const {
    check_leaf(node);
    const std::string& value = e["value"];
    if (value.find(':') != value.npos)
        return [samples = parse_spectrum_list(value, e.where)](SpectrumRole role) {
            return spectrum_colour(samples, role);
        };
    const std::vector<double> numbers = parse_floats(value, e.where);
    // A constant is grey in emitters too, a scaled D65, as in Mitsuba 0.6. Builds of Mitsuba 0.6 with three spectral
    // samples take three numbers as a colour.
    if (numbers.size() == 1 || (numbers.size() == 3 && source_->is_old()))
        return [c = to_rgb(parse_triple(value, e.where), e.where)](SpectrumRole) { return c; };
    throw SceneError(
        e.where,
        fmt::format("expected one number or a list of wavelength:value, found {}", quote(value)));
}

MitsubaReader::SpectrumOfRole MitsubaReader::spectrum_from_plugin(const Element& e,
                                                                  const pugi::xml_node& node,
                                                                  const Scope& scope) {
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
    SceneObject plugin = std::move(scene_.objects.back());
    scene_.objects.pop_back();
    return [plugin = std::move(plugin)](SpectrumRole role) {
        return spectrum_plugin_colour(plugin, role);
    };
}

void MitsubaReader::set_spectra_of_textures() {
    if (texture_spectra_.empty()) return;
    std::map<int, std::vector<std::pair<int, std::string>>> uses;  // as which parameter of what
    for (size_t i = 0; i < scene_.objects.size(); ++i)
        for (const auto& c : scene_.objects[i].children)
            if (scene_.objects[size_t(c.object)].category == "texture")
                uses[c.object].emplace_back(int(i), c.name);
    std::map<int, std::optional<SpectrumRole>> known;
    const std::function<std::optional<SpectrumRole>(int)> role_of =
        [&](int texture) -> std::optional<SpectrumRole> {
        const auto [entry, is_new] = known.try_emplace(texture);
        if (!is_new) return entry->second;
        std::optional<SpectrumRole> all;
        for (const auto& [user, name] : uses[texture]) {
            const std::string& category = scene_.objects[size_t(user)].category;
            const std::optional<SpectrumRole> role =
                category == "texture" && name != "scale"
                    ? role_of(user)
                    : spectrum_role(category, name, category == "emitter");
            // Of several uses none may be cut off.
            if (role) all = !all || all == role ? *role : SpectrumRole::Ratio;
        }
        return known[texture] = all;
    };
    for (const TextureSpectrum& s : texture_spectra_)
        if (const auto role = role_of(s.texture); role && s.name != "scale")
            for (Param& p : scene_.objects[size_t(s.texture)].params)
                if (p.name == s.name) p.value = s.colour(*role);
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
