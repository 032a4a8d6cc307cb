#include "readers/mitsuba_old_versions.h"

#include <string>
#include <string_view>
#include <vector>

namespace etendue {
namespace {

using pugi::xml_node;

std::string_view name_of(const xml_node& node) {
    return node.attribute("name").value();
}
std::string_view type_of(const xml_node& node) {
    return node.attribute("type").value();
}
bool is(const xml_node& node, std::string_view element, std::string_view type) {
    return node.name() == element && type_of(node) == type;
}
xml_node child(const xml_node& parent, std::string_view name) {
    for (const xml_node& c : parent.children())
        if (name_of(c) == name) return c;
    return {};
}

struct Rename {
    const char *element, *type;  ///< Of the parent; an empty type is any.
    const char *from, *to;
};

void rename_children(const xml_node& parent, const std::vector<Rename>& renames) {
    for (const xml_node& c : parent.children())
        for (const Rename& r : renames)
            if (parent.name() == std::string_view(r.element) &&
                (!*r.type || type_of(parent) == r.type) && name_of(c) == r.from) {
                c.attribute("name").set_value(r.to);
                break;
            }
}

void rename_type(const xml_node& node, const std::vector<Rename>& renames) {
    for (const Rename& r : renames)
        if (is(node, r.element, r.from)) {
            node.attribute("type").set_value(r.to);
            return;
        }
}

void prepend_mirror(xml_node transform) {
    transform.prepend_child("scale").append_attribute("x").set_value("-1");
}

// ---- Before 0.3.0

/// The reflectance `name` times the number `amount`, which newer versions do not have.
void apply_amount(xml_node bsdf, const char* name, const char* amount, const char* fallback) {
    xml_node reflectance = child(bsdf, name);
    if (!reflectance) {
        reflectance = bsdf.append_child("spectrum");
        reflectance.append_attribute("name").set_value(name);
        reflectance.append_attribute("value").set_value(fallback);
    }
    const xml_node factor = child(bsdf, amount);
    if (!factor) return;
    xml_node product = bsdf.append_child("texture");
    product.append_attribute("type").set_value("scale");
    product.append_attribute("name").set_value(name);
    reflectance.attribute("name").set_value("value");
    product.append_move(reflectance);
    xml_node scale = factor;
    scale.attribute("name").set_value("scale");
    product.append_move(scale);
}

void split_triples(xml_node look_at) {
    for (const auto& [to, letter] : {std::pair("origin", 'o'), {"target", 't'}, {"up", 'u'}}) {
        std::string triple;
        for (const char axis : {'x', 'y', 'z'}) {
            const std::string name{letter, axis};
            if (const auto a = look_at.attribute(name.c_str())) {
                triple += (triple.empty() ? "" : ", ") + std::string(a.value());
                look_at.remove_attribute(a);
            }
        }
        if (!triple.empty()) look_at.append_attribute(to).set_value(triple.c_str());
    }
}

void upgrade_to_0_3(xml_node node) {
    static const std::vector<Rename> kParams = {
        {"shape", "sphere", "inverted", "flipNormals"},
        {"shape", "cylinder", "p1", "p0"},
        {"shape", "cylinder", "p2", "p1"},
        {"texture", "checkerboard", "brightColor", "color0"},
        {"texture", "checkerboard", "darkColor", "color1"},
        {"texture", "gridtexture", "brightColor", "color0"},
        {"texture", "gridtexture", "darkColor", "color1"},
        {"bsdf", "ward", "alphaX", "alphaU"},
        {"bsdf", "ward", "alphaY", "alphaV"},
        {"bsdf", "microfacet", "alphaB", "alpha"},
        {"bsdf", "roughmetal", "alphaB", "alpha"},
        {"bsdf", "roughmetal", "ior", "eta"},
        {"bsdf", "roughglass", "alphaB", "alpha"},
        {"medium", "", "sizeMultiplier", "densityMultiplier"},
    };
    static const std::vector<Rename> kTypes = {
        {"bsdf", "", "lambertian", "diffuse"},         {"bsdf", "", "microfacet", "roughplastic"},
        {"bsdf", "", "mirror", "conductor"},           {"bsdf", "", "roughmetal", "roughconductor"},
        {"bsdf", "", "roughglass", "roughdielectric"}, {"bsdf", "", "composite", "mixturebsdf"},
        {"texture", "", "exrtexture", "bitmap"},       {"texture", "", "ldrtexture", "bitmap"},
    };
    const bool is_microfacet = is(node, "bsdf", "microfacet");
    if (is_microfacet || is(node, "bsdf", "phong") || is(node, "bsdf", "ward")) {
        apply_amount(node, "diffuseReflectance", "diffuseAmount", is_microfacet ? "0" : "0.5");
        apply_amount(node, "specularReflectance", "specularAmount", is_microfacet ? "1" : "0.2");
    }
    if (is(node, "bsdf", "mirror")) {
        xml_node material = node.append_child("string");
        material.append_attribute("name").set_value("material");
        material.append_attribute("value").set_value("Cr");
    }
    if (node.name() == std::string_view("lookAt") && node.attribute("ox")) {
        split_triples(node);
        node.parent().insert_child_before("scale", node).append_attribute("x").set_value("-1");
    }
    rename_children(node, kParams);
    rename_type(node, kTypes);
}

// ---- From 0.3.x to 0.4.0

void upgrade_camera(xml_node camera) {
    if (xml_node to_world = child(camera, "toWorld")) prepend_mirror(to_world);
    if (type_of(camera) == "perspective") {
        const xml_node smaller = child(camera, "mapSmallerSide");
        const bool is_larger =
            smaller && smaller.attribute("value").value() == std::string_view("false");
        if (smaller) camera.remove_child(smaller);
        xml_node axis = camera.append_child("string");
        axis.append_attribute("name").set_value("fovAxis");
        axis.append_attribute("value").set_value(is_larger ? "larger" : "smaller");
    }
    camera.set_name("sensor");
}

void upgrade_to_0_4(xml_node node) {
    static const std::vector<Rename> kParams = {
        {"luminaire", "area", "intensity", "radiance"},
        {"luminaire", "constant", "intensity", "radiance"},
        {"luminaire", "directional", "intensity", "irradiance"},
        {"luminaire", "", "intensityScale", "scale"},
        {"integrator", "", "luminaireSamples", "emitterSamples"},
        {"sampler", "", "depth", "dimension"},
        {"camera", "", "focusDepth", "focusDistance"},
        {"medium", "", "densityMultiplier", "scale"},
    };
    static const std::vector<Rename> kTypes = {
        {"integrator", "", "errctrl", "adaptive"},
        {"film", "", "exrfilm", "hdrfilm"},
        {"film", "", "pngfilm", "ldrfilm"},
    };
    rename_children(node, kParams);
    rename_type(node, kTypes);
    const std::string_view name = node.name();
    if (name == "film")
        if (xml_node alpha = child(node, "alpha"); alpha.name() == std::string_view("boolean")) {
            const bool is_true = alpha.attribute("value").value() == std::string_view("true");
            alpha.set_name("string");
            alpha.attribute("name").set_value("pixelFormat");
            alpha.attribute("value").set_value(is_true ? "rgba" : "rgb");
        }
    if (name == "blackbody")
        if (auto multiplier = node.attribute("multiplier")) multiplier.set_name("scale");
    if (name == "camera") upgrade_camera(node);
    if (name == "luminaire") node.set_name("emitter");
}

/// Calls upgrade(node) for the element and all within it, those within first.
template <class Upgrade>
void for_each_element(xml_node root, const Upgrade& upgrade) {
    xml_node at = root;
    while (at.first_child()) at = at.first_child();
    for (;;) {
        const xml_node parent = at.parent(), next = at.next_sibling();
        if (at.type() == pugi::node_element) upgrade(at);
        if (at == root) return;
        if (!next) {
            at = parent;
            continue;
        }
        at = next;
        while (at.first_child()) at = at.first_child();
    }
}

}  // namespace

void upgrade_old_version(xml_node root, const std::array<int, 3>& version) {
    if (version < std::array{0, 3, 0}) for_each_element(root, upgrade_to_0_3);
    if (version < std::array{0, 4, 0}) for_each_element(root, upgrade_to_0_4);
}

}  // namespace etendue
