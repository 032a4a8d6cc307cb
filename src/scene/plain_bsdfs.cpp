#include "scene/plain_bsdfs.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

#include <fmt/format.h>

#include "bsdf/coat.h"
#include "bsdf/ior.h"
#include "color/metals.h"

namespace etendue {
namespace {

/// What a coat absorbs on the mean becomes part of the reflectance ρ of its base: ρ' reflects as much without it,
///     ρ' / (1 − ρ' F) = A ρ / (1 − ρ F_τ),
/// or, where the coat does not saturate colours, ρ' / (1 − F) = A ρ / (1 − F_τ).
void replace_absorption(PlainScene& s, SceneObject& o) {
    const double tau = number(o, "thickness", 0);
    if (!(tau > 0) || has_texture(o, "diffuse_reflectance")) return;
    const Params params{s.scene(), s.index_of(o)};
    const float eta =
        read_ior(params, "int_ior", "polypropylene") / read_ior(params, "ext_ior", "air");
    if (!(eta > 1)) return;
    // Mean of 1 / cos below the coat for diffuse light from above, which passes twice.
    const double eta2 = double(eta) * double(eta);
    const double mean_path = 2 * eta2 * (1 - std::sqrt(1 - 1 / eta2));
    const double A = std::exp(-2 * tau * mean_path), F = double(reflectance_below_coat(eta, 0)),
                 F_tau = double(reflectance_below_coat(eta, float(tau)));
    const Param* flag = o.find("nonlinear");
    const bool saturates = flag && std::get<bool>(flag->value);
    Rgb base = rgb(o, "diffuse_reflectance", Rgb(0.5f));
    for (int c = 0; c < 3; ++c) {
        const double rho = double(base[c]);
        const double reflected = A * rho / (1 - (saturates ? rho : 1) * F_tau);
        base[c] = float(saturates ? reflected / (1 + reflected * F) : reflected * (1 - F));
    }
    s.warn(o, fmt::format("Mitsuba 3 has no parameter \"thickness\" of bsdf \"{}\": the mean "
                          "absorption of the coat becomes part of \"diffuse_reflectance\"",
                          o.type));
    remove(o, "thickness");
    set(o, "diffuse_reflectance", base);
}

/// Makes a parameter or texture of `from` one of `to`.
void move(SceneObject& from, std::string_view name, SceneObject& to, const std::string& new_name) {
    if (const Param* p = from.find(name)) to.params.push_back({new_name, p->value, p->where});
    for (const auto& c : from.children)
        if (c.name == name) to.children.push_back({new_name, c.object, c.where});
    remove(from, name);
}

/// The reflectance at normal incidence becomes an index of refraction.
void replace_own_reflectance(PlainScene& s, SceneObject& o) {
    if (!has(o, "specular_weight") && !has(o, "specular_color")) return;
    const auto factor = [&](const char* name) {
        if (has_texture(o, name)) return 1.0;
        return double(luminance(rgb(o, name, Rgb(1))));
    };
    const double eta = number(o, "eta", 1.5), specular = number(o, "specular", 0.5);
    const double F0 = o.find("specular") ? 0.08 * specular : std::pow((eta - 1) / (eta + 1), 2);
    const double root =
        std::sqrt(std::clamp(F0 * factor("specular_weight") * factor("specular_color"), 0.0, 0.98));
    if (!s.is_stand_in(s.index_of(o)))
        s.warn(o, "Mitsuba 3 has no parameters \"specular_weight\" and \"specular_color\" of bsdf "
                  "\"principled\": an index of refraction with their mean reflectance at normal "
                  "incidence stands in for them");
    for (const char* name : {"specular_weight", "specular_color", "specular"}) remove(o, name);
    set(o, "eta", std::max((1 + root) / (1 - root), 1.001));
}

bool is_zero(const SceneObject& o, std::string_view name) {
    return !has_texture(o, name) && number(o, name, 0) == 0;
}

bool is_nested_in(PlainScene& s, int index, std::string_view type) {
    return std::any_of(
        s.scene().objects.begin(), s.scene().objects.end(), [&](const SceneObject& o) {
            return o.type == type && std::any_of(o.children.begin(), o.children.end(),
                                                 [&](const auto& c) { return c.object == index; });
        });
}

void nest_in_twosided(PlainScene& s, int index) {
    SceneObject inner = s.object(index);
    SceneObject both_sides{"bsdf", "twosided", inner.id, inner.where, {}, {}};
    inner.id.clear();
    both_sides.children = {{"", s.add(std::move(inner)), both_sides.where}};
    s.object(index) = std::move(both_sides);
}

/// The nearest that Mitsuba 3 has: its principled model, of which energy is not conserved; a blend with a pane for thin
/// glass.
void replace_openpbr(PlainScene& s, int index) {
    {
        SceneObject& o = s.object(index);
        const bool is_mixed_glass =
            !is_zero(o, "transmission_weight") && has(o, "transmission_color");
        const bool affects_below =
            !is_zero(o, "coat_weight") &&
            (number(o, "coat_affect_ior", 1) != 0 || number(o, "coat_affect_roughness", 1) != 0);
        s.stand_in(o, "principled",
                   std::string("white surfaces reflect 0.70 to 1.05 of the light instead of all of "
                               "it, and colours of the specular reflection, the coat and the fuzz "
                               "are left out") +
                       (affects_below ? "; what lies below the coat is as without it, as if "
                                        "\"coat_affect_ior\" and \"coat_affect_roughness\" were 0"
                                      : ""));
        // The base colour is that of glass as well.
        if (is_mixed_glass && !has_texture(o, "transmission_weight") &&
            number(o, "transmission_weight", 0) == 1 && number(o, "base_metalness", 0) == 0 &&
            !has_texture(o, "base_metalness")) {
            remove(o, "base_color"), remove(o, "base_weight");
            rename(o, "transmission_color", "base_color");
        }
        if (!has(o, "base_color")) set(o, "base_color", Rgb(0.8f));
        if (const double weight = number(o, "base_weight", 1);
            weight != 1 && !has_texture(o, "base_color"))
            set(o, "base_color", rgb(o, "base_color", Rgb(0.8f)) * float(weight));
        rename(o, "base_metalness", "metallic");
        rename(o, "specular_roughness", "roughness");
        if (!has(o, "roughness")) set(o, "roughness", 0.3);
        rename(o, "specular_ior", "eta");
        if (!has(o, "eta")) set(o, "eta", 1.5);
        replace_own_reflectance(s, o);
        // The ratio of the roughnesses along v and u is 1 − 0.9 anisotropic.
        if (const double a = number(o, "specular_roughness_anisotropy", 0); a > 0)
            set(o, "anisotropic", std::min(a / 0.9, 1.0));
        if (has(o, "coat_weight")) {
            // The gloss from 0 to 1 is an α from 0.1 to 0.001; textures of the roughness are taken for kTexel.
            constexpr double kTexel = 0.2;
            const double alpha = std::pow(
                number(o, "coat_roughness", has_texture(o, "coat_roughness") ? kTexel : 0), 2);
            rename(o, "coat_weight", "clearcoat");
            set(o, "clearcoat_gloss", std::clamp((0.1 - alpha) / 0.099, 0.0, 1.0));
        }
        rename(o, "fuzz_weight", "sheen");
        const Param* thin = o.find("thin_walled");
        const bool is_seen_from_both_sides = thin && std::get<bool>(thin->value);
        const bool is_thin = is_seen_from_both_sides && !is_zero(o, "transmission_weight");
        if (!is_thin) rename(o, "transmission_weight", "spec_trans");
        for (const char* name :
             {"base_weight", "base_diffuse_roughness", "specular_roughness_anisotropy",
              "coat_color", "coat_roughness", "coat_ior", "coat_affect_ior",
              "coat_affect_roughness", "fuzz_color", "fuzz_roughness", "thin_walled"})
            remove(o, name);
        if (!is_thin) {
            remove(o, "transmission_color");
            if (is_seen_from_both_sides && !is_nested_in(s, index, "twosided"))
                nest_in_twosided(s, index);
            return;
        }
    }
    SceneObject opaque = s.object(index);
    SceneObject pane{"bsdf", "thindielectric", "", opaque.where, {}, {}},
        blend{"bsdf", "blendbsdf", opaque.id, opaque.where, {}, {}},
        both_sides{"bsdf", "twosided", "", opaque.where, {}, {}};
    set(pane, "int_ior", number(opaque, "eta", 1.5));
    set(pane, "ext_ior", 1.0);
    move(opaque, "transmission_color", pane, "specular_transmittance");
    move(opaque, "transmission_weight", blend, "weight");
    opaque.id.clear();
    both_sides.children = {{"", s.add(std::move(opaque)), blend.where}};
    blend.children.push_back({"", s.add(std::move(both_sides)), blend.where});
    blend.children.push_back({"", s.add(std::move(pane)), blend.where});
    s.object(index) = std::move(blend);
}

void set_ior(SceneObject& o, double ior) {
    constexpr double kLeast = 1.001;  // Mitsuba 3 refuses coats without an interface.
    set(o, "int_ior", std::max(ior, kLeast));
    set(o, "ext_ior", 1.0);
}

/// A metal in a medium is one with the indices divided by that of the medium.
void replace_metal(PlainScene& s, SceneObject& o) {
    const Param* outside = o.find("ext_eta");
    if (!outside) return;
    const double n = read_ior({s.scene(), s.index_of(o)}, "ext_eta", "air");
    if (const Param* p = o.find("material"))
        if (const auto metal = named_metal(*p->as<std::string>())) {
            set(o, "eta", metal->eta), set(o, "k", metal->k);
            remove(o, "material");
        }
    for (const char* name : {"eta", "k"})
        if (o.find(name)) set(o, name, rgb(o, name, Rgb(0)) * float(1 / n));
    remove(o, "ext_eta");
}

/// A weighted sum is a chain of blends: each has its first material with the rest of the weight.
void replace_mixture(PlainScene& s, int index) {
    const SceneObject mixture = s.object(index);
    std::string text = mixture.find("weights") ? *mixture.find("weights")->as<std::string>() : "";
    std::replace(text.begin(), text.end(), ',', ' ');
    std::istringstream in(text);
    in.imbue(std::locale::classic());  // not that of the program around this library
    std::vector<double> weights;
    for (double w; in >> w;) weights.push_back(w);
    std::vector<int> materials;
    for (const auto& c : mixture.children) materials.push_back(c.object);
    if (weights.size() != materials.size() || weights.empty()) return;
    double sum = 0;
    for (const double w : weights) sum += w;
    if (sum > 1) {
        const Param* p = mixture.find("ensure_energy_conservation");
        if (p && !std::get<bool>(p->value))
            s.warn(mixture, "Mitsuba 3 has no weights with a sum above one: they are divided by "
                            "their sum");
        for (double& w : weights) w /= sum;
    }
    if (sum < 1) {
        SceneObject black{"bsdf", "diffuse", "", mixture.where, {}, {}};
        set(black, "reflectance", Rgb(0));
        materials.push_back(s.add(std::move(black)));
        weights.push_back(1 - sum);
    }
    int rest = materials.back();
    double rest_weight = weights.back();
    for (size_t i = materials.size() - 1; i-- > 0;) {
        SceneObject blend{"bsdf", "blendbsdf", "", mixture.where, {}, {}};
        const double both = weights[i] + rest_weight;
        set(blend, "weight", both > 0 ? rest_weight / both : 0.5);
        blend.children = {{"", materials[i], mixture.where}, {"", rest, mixture.where}};
        rest_weight = both;
        rest = i == 0 ? index : s.add(SceneObject(blend));
        if (i == 0) {
            blend.id = mixture.id;
            s.object(index) = std::move(blend);
        }
    }
}

}  // namespace

void replace_bsdf(PlainScene& s, int index) {
    // Options of newer versions that depend on which direction is the view's, and are on by default.
    if (s.object(index).type == "bumpmap" || s.object(index).type == "normalmap")
        for (const char* name : {"flip_invalid_normals", "use_shadowing_function"})
            set(s.object(index), name, false);
    if (s.object(index).type == "mixturebsdf") return replace_mixture(s, index);
    if (s.object(index).type == "openpbr") return replace_openpbr(s, index);
    SceneObject& o = s.object(index);
    if (o.type == "orennayar") {
        s.stand_in(o, "diffuse");
    } else if (o.type == "diffusetransmission") {
        const double r = number(o, "reflectance", 0.25), t = number(o, "transmittance", 0.25);
        const Rgb sum = rgb(o, "reflectance", Rgb(0.25f)) + rgb(o, "transmittance", Rgb(0.25f));
        s.stand_in(o, "principledthin");
        // Twice the share of what is transmitted.
        set(o, "diff_trans", r + t > 0 ? 2 * t / (r + t) : 1);
        set(o, "roughness", 1.0);
        set(o, "eta", 1.001);
        if (has_texture(o, "transmittance"))
            rename(o, "transmittance", "base_color");
        else
            set(o, "base_color", sum);
        remove(o, "reflectance"), remove(o, "transmittance");
    } else if (o.type == "phong") {
        const double n = number(o, "exponent", 30);
        s.stand_in(o, "roughplastic");
        remove(o, "exponent");
        set(o, "alpha", std::sqrt(2 / (n + 2)));
    } else if (o.type == "fresnelblend") {
        const double r = std::clamp(number(o, "specular_reflectance", 0.5), 0.0, 0.98);
        s.stand_in(o, "roughplastic");
        set_ior(o, (1 + std::sqrt(r)) / (1 - std::sqrt(r)));
        remove(o, "specular_reflectance");
    } else if (o.type == "lobesum") {
        const bool is_smooth =
            number(o, "glossy_reflectance", 0.25) == 0 && !has_texture(o, "glossy_reflectance");
        const double eta = number(o, "eta", 1.5);
        s.stand_in(o, is_smooth ? "plastic" : "roughplastic");
        if (!is_smooth) {
            remove(o, "specular_reflectance");
            rename(o, "glossy_reflectance", "specular_reflectance");
        }
        if (!has(o, "diffuse_reflectance")) set(o, "diffuse_reflectance", Rgb(0.25f));
        remove(o, "eta");
        set_ior(o, eta);
    } else if (o.type == "coatedconductor") {
        s.stand_in(o, "roughconductor");
        if (has(o, "reflectance")) {
            rename(o, "reflectance", "specular_reflectance");
            set(o, "material", std::string("none"));
        }
    }
    if (o.type == "principled") replace_own_reflectance(s, o);
    if (o.type == "plastic" || o.type == "roughplastic") replace_absorption(s, o);
    if (o.type == "roughplastic") {
        const bool is_anisotropic = number(o, "alpha_u", 0.1) != number(o, "alpha_v", 0.1) ||
                                    has_texture(o, "alpha_u") || has_texture(o, "alpha_v");
        if (is_anisotropic && !s.is_stand_in(index))
            s.warn(o, "Mitsuba 3 has no parameters \"alpha_u\" and \"alpha_v\" of bsdf "
                      "\"roughplastic\": their geometric mean stands in for them");
        if (o.find("alpha_u") || o.find("alpha_v"))
            set(o, "alpha", std::sqrt(number(o, "alpha_u", 0.1) * number(o, "alpha_v", 0.1)));
        remove(o, "alpha_u"), remove(o, "alpha_v");
    }
    if (o.type == "conductor" || o.type == "roughconductor") replace_metal(s, o);
}

void hoist_masks(PlainScene& s, int index) {
    SceneObject& o = s.object(index);
    if (o.category != "bsdf" || o.type != "twosided" || o.children.size() != 1) return;
    const SceneObject inner = s.object(o.children[0].object);
    if (inner.type != "mask") return;
    SceneObject both = o;
    const std::string id = o.id;
    both.id.clear();
    SceneObject mask = inner;
    mask.id = id;
    const int added = s.add(SceneObject(both));
    for (SceneObject::Child& c : mask.children)
        if (s.object(c.object).category == "bsdf") {
            s.object(added).children = {c};
            c.object = added;
            c.name.clear();
        }
    s.object(index) = mask;
    hoist_masks(s, added);
}

}  // namespace etendue
