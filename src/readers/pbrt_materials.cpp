// pbrt's materials. They reflect on both sides; roughness is GGX, remapped to α unless `remaproughness` is off.

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "readers/mitsuba_values.h"
#include "readers/pbrt_scene.h"
#include "readers/pbrt_spectrum.h"

namespace etendue {
namespace {

// ---- What most materials share

int wrap(PbrtScene& scene, const char* wrapper, int nested, PbrtPlace where) {
    const int object = scene.add("bsdf", wrapper, where);
    scene.add_child(object, "", nested);
    return object;
}

/// Adds bump and normal maps.
int with_maps(PbrtScene& scene, const PbrtArguments& args, int material) {
    const char* bump = scene.is_v3() ? "bumpmap" : "displacement";
    if (!scene.constant(args, bump, 0.0f)) {
        material = wrap(scene, "bumpmap", material, args.where());
        scene.add_child(material, "displacement", scene.texture(args, bump, true));
    }
    if (args.has("normalmap")) {
        const int image = scene.add("texture", "bitmap", args.where());
        scene.set(image, "filename", args.text("normalmap", ""));
        scene.set(image, "raw", true);
        scene.set(image, "to_uv", Transform::translate({0, 1, 0}) * Transform::scale({1, -1, 1}));
        material = wrap(scene, "normalmap", material, args.where());
        scene.add_child(material, "normalmap", image);
    }
    return material;
}

/// A material that reflects only, on both sides.
int reflecting(PbrtScene& scene, const PbrtArguments& args, int material) {
    return with_maps(scene, args, wrap(scene, "twosided", material, args.where()));
}

/// α of a roughness: its square root in pbrt-v4, a polynomial of its logarithm in v3.
float remapped(const PbrtScene& scene, float roughness) {
    if (!scene.is_v3()) return std::sqrt(std::max(roughness, 0.0f));
    const double x = std::log(std::max(double(roughness), 1e-3));
    return float(1.62142 + 0.819955 * x + 0.1734 * x * x + 0.0171201 * x * x * x +
                 0.000640711 * x * x * x * x);
}

struct PbrtRoughness {
    std::array<std::optional<float>, 2> alpha;  ///< Along u and v; nothing where it is a texture.
    std::array<int, 2> texture = {-1, -1};
    bool given_zero = false;  ///< Both are given as 0, before any remapping.

    bool is_constant() const { return alpha[0] && alpha[1]; }
    bool is_isotropic() const {
        return is_constant() ? *alpha[0] == *alpha[1] : texture[0] == texture[1];
    }
    /// pbrt-v4 takes what is sharper than this for a mirror.
    bool is_mirror() const { return is_constant() && std::max(*alpha[0], *alpha[1]) < 1e-3f; }
};

/// "uroughness" and "vroughness", or "roughness" for both, with a prefix.
PbrtRoughness read_roughness(PbrtScene& scene, const PbrtArguments& args, float fallback,
                             const std::string& prefix = "") {
    PbrtRoughness r;
    const bool remap = args.flag("remaproughness", true);
    r.given_zero = true;
    for (size_t i = 0; i < 2; ++i) {
        if (i == 1 && !args.has(prefix + "uroughness") && !args.has(prefix + "vroughness")) {
            r.alpha[1] = r.alpha[0];
            r.texture[1] = r.texture[0];
            break;
        }
        std::string name = prefix + (i == 0 ? "uroughness" : "vroughness");
        if (!args.has(name)) name = prefix + "roughness";
        if (const auto x = scene.constant(args, name, fallback)) {
            r.given_zero = r.given_zero && *x == 0;
            r.alpha[i] = remap ? remapped(scene, *x) : *x;
            continue;
        }
        r.given_zero = false;
        r.texture[i] = scene.texture(args, name, true);
        if (!remap) continue;
        const int remapping = scene.add("texture", "roughness_to_alpha", args.where());
        scene.set(remapping, "curve", std::string(scene.is_v3() ? "pbrt3" : "pbrt4"));
        scene.add_child(remapping, "roughness", r.texture[i]);
        r.texture[i] = remapping;
    }
    return r;
}

/// The distribution of all facets of a material, those of a coat and of what is below it.
void set_ggx(PbrtScene& scene, int object) {
    if (!scene.object(object).find("distribution"))
        scene.set(object, "distribution", std::string("ggx"));
}

void set_roughness(PbrtScene& scene, int object, const PbrtRoughness& r) {
    set_ggx(scene, object);
    const char* names[2] = {"alpha_u", "alpha_v"};
    for (size_t i = 0; i < 2; ++i)
        if (r.alpha[i])
            scene.set(object, names[i], Rgb(*r.alpha[i]));
        else
            scene.add_child(object, names[i], r.texture[i]);
}

/// One α for models that have no other.
void set_isotropic_alpha(PbrtScene& scene, const PbrtArguments& args, int object,
                         const PbrtRoughness& r, const char* name) {
    set_ggx(scene, object);
    if (!r.is_isotropic())
        scene.refuse(
            args.where(),
            fmt::format("the roughness of {} must be the same along u and v", quote(args.name())),
            r.is_constant() ? "their geometric mean" : "that along u");
    if (r.is_constant())
        scene.set(object, name, double(std::sqrt(*r.alpha[0] * *r.alpha[1])));
    else if (r.alpha[0])
        scene.set(object, name, double(*r.alpha[0]));
    else
        scene.add_child(object, name, r.texture[0]);
}

/// Index of refraction of a dielectric; a spectrum's at the sodium line.
float read_eta(PbrtScene& scene, const PbrtArguments& args, const char* name, float fallback) {
    const PbrtValue* v = args.find(name);
    if (!v) return fallback;
    if (v->type == PbrtType::Texture) {
        const auto c = scene.constant(args, name, fallback);
        if (!c) {
            scene.refuse(v->where, "an index of refraction from a texture is not supported", "1.5");
            return 1.5f;
        }
        return *c;
    }
    const float eta = pbrt_number(*v, scene);
    if (!(eta > 0))
        args.fail(name, fmt::format("parameter \"{}\" is {}, but must be above zero", name, eta));
    return eta;
}

void set_ior(PbrtScene& scene, int object, float eta) {
    scene.set(object, "int_ior", double(eta));
    scene.set(object, "ext_ior", 1.0);
}

int add_diffuse(PbrtScene& scene, const PbrtArguments& args, const char* colour, float sigma) {
    const int diffuse = scene.add("bsdf", sigma > 0 ? "orennayar" : "diffuse", args.where());
    scene.bind(diffuse, "reflectance", args, colour, Rgb(0.5f));
    if (sigma > 0) scene.set(diffuse, "sigma", double(sigma));
    return diffuse;
}

float read_sigma(PbrtScene& scene, const PbrtArguments& args) {
    const auto sigma = scene.constant(args, "sigma", 0.0f);
    if (!sigma)
        scene.refuse(args.find("sigma")->where, "a texture of sigma is not supported",
                     "20 degrees");
    return clamp(sigma.value_or(20.0f), 0, 90);
}

// ---- Both versions

int make_interface(PbrtScene& scene, const PbrtArguments& args) {
    return scene.add("bsdf", "null", args.where());
}

int nested_material(PbrtScene& scene, const PbrtArguments& args, const PbrtValue& value,
                    const std::string& name) {
    const auto it = scene.named_materials.find(name);
    if (it != scene.named_materials.end()) return it->second;
    std::vector<std::string> known;
    for (const auto& [other, object] : scene.named_materials) known.push_back(other);
    throw SceneError(value.where,
                     fmt::format("{} \"{}\" mixes {}, which is no named material{}", args.kind(),
                                 args.name(), quote(name), hint(name, known)));
}

int make_mix(PbrtScene& scene, const PbrtArguments& args) {
    const int mix = scene.add("bsdf", "blendbsdf", args.where());
    int first, second;
    if (scene.is_v3()) {
        // Its amount is that of the first one.
        const PbrtValue *a = args.find("namedmaterial1"), *b = args.find("namedmaterial2");
        if (!a || !b) args.fail("a mix needs namedmaterial1 and namedmaterial2");
        second = nested_material(scene, args, *a, args.text("namedmaterial1", ""));
        first = nested_material(scene, args, *b, args.text("namedmaterial2", ""));
        if (const auto amount = scene.constant(args, "amount", Rgb(0.5f), PbrtSpectrum::Albedo))
            scene.set(mix, "weight", Rgb(luminance(*amount)));
        else
            scene.add_child(mix, "weight", scene.texture(args, "amount", false));
    } else {
        const PbrtValue* materials = args.find("materials");
        if (!materials || materials->strings.size() != 2)
            args.fail("materials", "a mix needs the names of two \"materials\"");
        first = nested_material(scene, args, *materials, materials->strings[0]);
        second = nested_material(scene, args, *materials, materials->strings[1]);
        scene.bind_float(mix, "weight", args, "amount", 0.5f);
    }
    scene.add_child(mix, "", first);
    scene.add_child(mix, "", second);
    return mix;
}

// ---- pbrt-v4

int make_diffuse(PbrtScene& scene, const PbrtArguments& args) {
    return reflecting(scene, args,
                      add_diffuse(scene, args, "reflectance", read_sigma(scene, args)));
}

/// With η = 1, a metal of normal reflectance R has k = 2 √R / √(1 − R).
Rgb k_of_reflectance(Rgb R) {
    Rgb k;
    for (int i = 0; i < 3; ++i) {
        const float r = clamp(R[i], 0, 0.9999f);
        k[i] = 2 * std::sqrt(r) / std::sqrt(1 - r);
    }
    return k;
}

/// Index of refraction; copper's by default.
void bind_metal(PbrtScene& scene, int metal, const PbrtArguments& args,
                const std::string& prefix = "") {
    const Rgb copper_eta(0.2009f, 0.9238f, 1.1016f), copper_k(3.913f, 2.4532f, 2.1411f);
    scene.bind(metal, "eta", args, (prefix + "eta").c_str(), copper_eta, PbrtSpectrum::Unbounded);
    scene.bind(metal, "k", args, (prefix + "k").c_str(), copper_k, PbrtSpectrum::Unbounded);
}

int add_metal(PbrtScene& scene, const PbrtArguments& args, const PbrtRoughness& r, bool mirror) {
    const int metal = scene.add("bsdf", mirror ? "conductor" : "roughconductor", args.where());
    if (!mirror) set_roughness(scene, metal, r);
    if (args.has("reflectance")) {
        if (args.has("eta") || args.has("k"))
            args.fail("reflectance", "give either reflectance, or eta and k, not both");
        auto R = scene.constant(args, "reflectance", Rgb(0.5f), PbrtSpectrum::Albedo);
        if (!R) {
            scene.set(metal, "material", std::string("none"));
            scene.add_child(metal, "specular_reflectance",
                            scene.texture(args, "reflectance", false));
            scene.warn(args.find("reflectance")->where,
                       "a metal's reflectance from a texture does not rise toward grazing angles");
            return metal;
        }
        scene.set(metal, "eta", Rgb(1));
        scene.set(metal, "k", k_of_reflectance(*R));
        return metal;
    }
    bind_metal(scene, metal, args);
    return metal;
}

int make_conductor(PbrtScene& scene, const PbrtArguments& args) {
    const PbrtRoughness r = read_roughness(scene, args, 0);
    return reflecting(scene, args, add_metal(scene, args, r, r.is_mirror()));
}

int make_dielectric(PbrtScene& scene, const PbrtArguments& args) {
    const PbrtRoughness r = read_roughness(scene, args, 0);
    const float eta = read_eta(scene, args, "eta", 1.5f);
    const bool smooth = r.is_mirror() || eta == 1;
    const int glass = scene.add("bsdf", smooth ? "dielectric" : "roughdielectric", args.where());
    if (!smooth) set_roughness(scene, glass, r);
    set_ior(scene, glass, eta);
    return with_maps(scene, args, glass);
}

int make_thindielectric(PbrtScene& scene, const PbrtArguments& args) {
    const int glass = scene.add("bsdf", "thindielectric", args.where());
    set_ior(scene, glass, read_eta(scene, args, "eta", 1.5f));
    return with_maps(scene, args, glass);
}

/// A coat that scatters inside is a volume.
void refuse_coat_medium(PbrtScene& scene, const PbrtArguments& args) {
    const auto albedo = scene.constant(args, "albedo", Rgb(0), PbrtSpectrum::Albedo);
    if (!albedo || albedo->max() > 0)
        scene.refuse(args.find("albedo")->where,
                     "a coat that scatters (albedo above 0) is not supported", "a clear one");
}

/// pbrt's coats have the absorption coefficient 1.
void set_thickness(PbrtScene& scene, int object, const PbrtArguments& args) {
    std::optional<float> thickness = scene.constant(args, "thickness", 0.01f);
    if (!thickness) {
        scene.refuse(args.find("thickness")->where,
                     "the thickness of a coat must be a number, not a texture", "0.01");
        thickness = 0.01f;
    }
    scene.set(object, "thickness", double(std::max(*thickness, 0.0f)));
}

int make_coateddiffuse(PbrtScene& scene, const PbrtArguments& args) {
    refuse_coat_medium(scene, args);
    const PbrtRoughness r = read_roughness(scene, args, 0);
    const bool smooth = r.is_mirror();
    const int coated = scene.add("bsdf", smooth ? "plastic" : "roughplastic", args.where());
    scene.bind(coated, "diffuse_reflectance", args, "reflectance", Rgb(0.5f));
    scene.set(coated, "nonlinear", true);
    set_ior(scene, coated, read_eta(scene, args, "eta", 1.5f));
    set_thickness(scene, coated, args);
    if (!smooth) set_isotropic_alpha(scene, args, coated, r, "alpha");
    return reflecting(scene, args, coated);
}

int make_coatedconductor(PbrtScene& scene, const PbrtArguments& args) {
    refuse_coat_medium(scene, args);
    const PbrtRoughness metal = read_roughness(scene, args, 0, "conductor."),
                        coat = read_roughness(scene, args, 0, "interface.");
    const int coated = scene.add("bsdf", "coatedconductor", args.where());
    if (metal.is_mirror())
        scene.set(coated, "alpha", 0.0);
    else
        set_roughness(scene, coated, metal);
    if (!coat.is_mirror()) set_isotropic_alpha(scene, args, coated, coat, "coat_alpha");
    if (args.has("reflectance")) {
        if (args.has("conductor.eta") || args.has("conductor.k"))
            args.fail("reflectance", "give either reflectance, or eta and k, not both");
        scene.bind(coated, "reflectance", args, "reflectance", Rgb(0.5f));
    } else {
        bind_metal(scene, coated, args, "conductor.");
    }
    set_ior(scene, coated, read_eta(scene, args, "interface.eta", 1.5f));
    set_thickness(scene, coated, args);
    return reflecting(scene, args, coated);
}

int make_diffusetransmission(PbrtScene& scene, const PbrtArguments& args) {
    const float scale = args.number("scale", 1, 0);
    const int object = scene.add("bsdf", "diffusetransmission", args.where());
    for (const char* name : {"reflectance", "transmittance"}) {
        if (const auto c = scene.constant(args, name, Rgb(0.25f), PbrtSpectrum::Albedo)) {
            scene.set(object, name, *c * scale);
            continue;
        }
        const int texture = scene.texture(args, name, false);
        const int scaled = scene.add("texture", "scale", args.where());
        scene.add_child(scaled, "value", texture);
        scene.set(scaled, "scale", Rgb(scale));
        scene.add_child(object, name, scaled);
    }
    return with_maps(scene, args, object);
}

// ---- pbrt-v3

int make_matte(PbrtScene& scene, const PbrtArguments& args) {
    return reflecting(scene, args, add_diffuse(scene, args, "Kd", read_sigma(scene, args)));
}

int make_mirror(PbrtScene& scene, const PbrtArguments& args) {
    const int mirror = scene.add("bsdf", "conductor", args.where());
    scene.set(mirror, "material", std::string("none"));
    scene.bind(mirror, "specular_reflectance", args, "Kr", Rgb(0.9f));
    return reflecting(scene, args, mirror);
}

/// "eta", or its other name "index".
float read_index(PbrtScene& scene, const PbrtArguments& args) {
    return read_eta(scene, args, args.has("eta") ? "eta" : "index", 1.5f);
}

int make_glass(PbrtScene& scene, const PbrtArguments& args) {
    const PbrtRoughness r = read_roughness(scene, args, 0);
    const float eta = read_index(scene, args);
    const bool smooth = r.given_zero || eta == 1;
    const int glass = scene.add("bsdf", smooth ? "dielectric" : "roughdielectric", args.where());
    if (!smooth) set_roughness(scene, glass, r);
    set_ior(scene, glass, eta);
    scene.bind(glass, "specular_reflectance", args, "Kr", Rgb(1));
    scene.bind(glass, "specular_transmittance", args, "Kt", Rgb(1));
    return with_maps(scene, args, glass);
}

int make_metal(PbrtScene& scene, const PbrtArguments& args) {
    return reflecting(scene, args,
                      add_metal(scene, args, read_roughness(scene, args, 0.01f), false));
}

int make_substrate(PbrtScene& scene, const PbrtArguments& args) {
    const int substrate = scene.add("bsdf", "fresnelblend", args.where());
    set_roughness(scene, substrate, read_roughness(scene, args, 0.1f));
    scene.bind(substrate, "diffuse_reflectance", args, "Kd", Rgb(0.5f));
    scene.bind(substrate, "specular_reflectance", args, "Ks", Rgb(0.5f));
    return reflecting(scene, args, substrate);
}

int make_plastic(PbrtScene& scene, const PbrtArguments& args) {
    const int plastic = scene.add("bsdf", "lobesum", args.where());
    set_roughness(scene, plastic, read_roughness(scene, args, 0.1f));
    scene.bind(plastic, "diffuse_reflectance", args, "Kd", Rgb(0.25f));
    scene.bind(plastic, "glossy_reflectance", args, "Ks", Rgb(0.25f));
    // pbrt-v3 has the plastic on the side of the light: 1.5 outside, 1 inside.
    scene.set(plastic, "eta", 1 / 1.5);
    return with_maps(scene, args, plastic);
}

/// A mask where light goes straight on.
int with_opacity(PbrtScene& scene, const PbrtArguments& args, int material) {
    const auto opacity = scene.constant(args, "opacity", Rgb(1), PbrtSpectrum::Albedo);
    if (opacity && opacity->r >= 1 && opacity->g >= 1 && opacity->b >= 1) return material;
    const int mask = wrap(scene, "mask", material, args.where());
    if (opacity)
        scene.set(mask, "opacity", Rgb(luminance(*opacity)));
    else
        scene.add_child(mask, "opacity", scene.texture(args, "opacity", false));
    return mask;
}

int make_uber(PbrtScene& scene, const PbrtArguments& args) {
    const int uber = scene.add("bsdf", "lobesum", args.where());
    set_roughness(scene, uber, read_roughness(scene, args, 0.1f));
    scene.bind(uber, "diffuse_reflectance", args, "Kd", Rgb(0.25f));
    scene.bind(uber, "glossy_reflectance", args, "Ks", Rgb(0.25f));
    scene.bind(uber, "specular_reflectance", args, "Kr", Rgb(0));
    scene.bind(uber, "specular_transmittance", args, "Kt", Rgb(0));
    scene.set(uber, "eta", double(read_index(scene, args)));
    return with_opacity(scene, args, with_maps(scene, args, uber));
}

int make_translucent(PbrtScene& scene, const PbrtArguments& args) {
    const int object = scene.add("bsdf", "lobesum", args.where());
    set_roughness(scene, object, read_roughness(scene, args, 0.1f));
    const auto colour = [&](const char* name, float fallback) {
        const auto c = scene.constant(args, name, Rgb(fallback), PbrtSpectrum::Albedo);
        if (!c)
            scene.refuse(args.find(name)->where,
                         "a translucent material with textures is not supported", "0.25");
        return c.value_or(Rgb(0.25f));
    };
    const Rgb kd = colour("Kd", 0.25f), ks = colour("Ks", 0.25f), r = colour("reflect", 0.5f),
              t = colour("transmit", 0.5f);
    scene.set(object, "diffuse_reflectance", kd * r);
    scene.set(object, "diffuse_transmittance", kd * t);
    scene.set(object, "glossy_reflectance", ks * r);
    scene.set(object, "glossy_transmittance", ks * t);
    scene.set(object, "eta", 1.5);
    return with_maps(scene, args, object);
}

int make_disney(PbrtScene& scene, const PbrtArguments& args) {
    if (args.flag("thin", false))
        scene.refuse(args.find("thin")->where, "the thin Disney material is not supported",
                     "the solid one");
    for (const char* name : {"scatterdistance", "flatness", "difftrans"})
        if (args.has(name))
            scene.reject(args.find(name)->where,
                         fmt::format("{} of the Disney material is not supported", quote(name)));
    const int object = scene.add("bsdf", "principled", args.where());
    scene.bind(object, "base_color", args, "color", Rgb(0.5f));
    const struct {
        const char *pbrt, *mitsuba;
        float fallback;
    } kFloats[] = {{"metallic", "metallic", 0},
                   {"roughness", "roughness", 0.5f},
                   {"speculartint", "spec_tint", 0},
                   {"anisotropic", "anisotropic", 0},
                   {"sheen", "sheen", 0},
                   {"sheentint", "sheen_tint", 0.5f},
                   {"clearcoat", "clearcoat", 0},
                   {"clearcoatgloss", "clearcoat_gloss", 1},
                   {"spectrans", "spec_trans", 0}};
    for (const auto& f : kFloats) scene.bind_float(object, f.mitsuba, args, f.pbrt, f.fallback);
    scene.set(object, "eta", double(read_eta(scene, args, "eta", 1.5f)));
    const auto transmission = scene.constant(args, "spectrans", 0.0f);
    return transmission && *transmission == 0 ? reflecting(scene, args, object)
                                              : with_maps(scene, args, object);
}

// ---- Tables

std::vector<PbrtParamInfo> operator+(std::vector<PbrtParamInfo> a,
                                     const std::vector<PbrtParamInfo>& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

std::vector<PbrtParamInfo> maps() {
    return {{"bumpmap", ParamKind::Texture, "", "Becomes bumpmap.", kV3},
            {"displacement", ParamKind::Texture, "", "Becomes bumpmap.", kV4},
            {"normalmap", ParamKind::String, "", "Image of normals: becomes normalmap.", kV4}};
}

std::vector<PbrtParamInfo> roughness(const char* fallback) {
    return std::vector<PbrtParamInfo>{
               {"roughness", ParamKind::Texture, fallback, "Roughness."},
               {"uroughness", ParamKind::Texture, "roughness", "Along the first tangent."},
               {"vroughness", ParamKind::Texture, "roughness", "Along the second tangent."},
               {"remaproughness", ParamKind::Bool, "true",
                "Whether roughness is turned into α; else it is α."}} +
           maps();
}

std::vector<PbrtParamInfo> metal_params() {
    return {{"eta", ParamKind::Texture, "copper", "Real part of the index of refraction."},
            {"k", ParamKind::Texture, "copper", "Imaginary part of the index of refraction."}};
}

PbrtParamInfo texture(const char* name, const char* fallback, const char* doc) {
    return {name, ParamKind::Texture, fallback, doc};
}

std::vector<PbrtEntry> make_entries() {
    const std::vector<PbrtParamInfo> index = {
        texture("eta", "1.5", "Index of refraction; of a spectrum that at 588 nm."),
        texture("index", "1.5", "Another name of eta, which counts if both are given.")};
    const PbrtParamInfo sigma = texture(
        "sigma", "0", "Standard deviation of the facets' slopes in degrees: becomes orennayar.");
    const std::vector<PbrtParamInfo> coat = {
        texture("thickness", "0.01", "Optical thickness of the coat, a number."),
        texture("g", "0", "Accepted; without effect."),
        texture("albedo", "0", "Rejected unless 0: a coat does not scatter."),
        {"maxdepth", ParamKind::Int, "", "Accepted; all interreflections count."},
        {"nsamples", ParamKind::Int, "", "Accepted; without effect."},
        {"twosided", ParamKind::Bool, "true", "Accepted; both sides are always coated."}};
    return {
        {"", kV3And4, "The same as interface.", {}, make_interface},
        {"interface", kV4, "Becomes null.", {}, make_interface},
        {"none", kV3, "Becomes null.", {}, make_interface},
        {"mix",
         kV3And4,
         "Becomes blendbsdf; v3: with the luminance of amount.",
         {{"materials", ParamKind::String, "", "Names of two materials.", kV4},
          {"namedmaterial1", ParamKind::String, "", "Name of the first material.", kV3},
          {"namedmaterial2", ParamKind::String, "", "Name of the second material.", kV3},
          texture("amount", "0.5", "Weight of the second material; v3: of the first material.")},
         make_mix},
        {"diffuse", kV4, "Becomes diffuse.",
         std::vector<PbrtParamInfo>{texture("reflectance", "0.5", "Albedo."), sigma} + maps(),
         make_diffuse},
        {"coateddiffuse", kV4,
         "Becomes plastic or roughplastic, nonlinear: sums in closed form what pbrt simulates.",
         roughness("0") +
             std::vector<PbrtParamInfo>{texture("reflectance", "0.5", "Albedo of the base."),
                                        texture("eta", "1.5", "Index of refraction of the coat.")} +
             coat,
         make_coateddiffuse},
        {"conductor", kV4, "Becomes conductor where α is below 0.001, else roughconductor.",
         roughness("0") + metal_params() +
             std::vector<PbrtParamInfo>{texture(
                 "reflectance", "", "Reflectance at normal incidence, instead of eta and k.")},
         make_conductor},
        {"dielectric", kV4, "Becomes dielectric where α is below 0.001, else roughdielectric.",
         roughness("0") + std::vector<PbrtParamInfo>{index[0]}, make_dielectric},
        {"thindielectric", kV4, "Becomes thindielectric.",
         std::vector<PbrtParamInfo>{index[0]} + maps(), make_thindielectric},
        {"diffusetransmission", kV4, "Becomes diffusetransmission.",
         std::vector<PbrtParamInfo>{
             texture("reflectance", "0.25", "Fraction of the light that is reflected."),
             texture("transmittance", "0.25", "Fraction of the light that is transmitted."),
             {"scale", ParamKind::Float, "1",
              "Factor by which reflectance and transmittance are multiplied."}} +
             maps(),
         make_diffusetransmission},
        {"coatedconductor", kV4, "Becomes coatedconductor, a closed form of what pbrt simulates.",
         std::vector<PbrtParamInfo>{
             texture("conductor.eta", "copper", "Real part of the metal's index of refraction."),
             texture("conductor.k", "copper", "Imaginary part of the index of refraction."),
             texture("reflectance", "",
                     "Reflectance of the metal at normal incidence, instead of its eta and k."),
             texture("conductor.roughness", "0", "Roughness of the metal."),
             texture("conductor.uroughness", "conductor.roughness",
                     "Roughness of the metal along the first tangent."),
             texture("conductor.vroughness", "conductor.roughness",
                     "Roughness of the metal along the second tangent."),
             texture("interface.roughness", "0", "Roughness of the coat."),
             texture("interface.uroughness", "interface.roughness",
                     "Roughness of the coat along the first tangent."),
             texture("interface.vroughness", "interface.roughness",
                     "Roughness of the coat along the second tangent."),
             texture("interface.eta", "1.5", "Index of refraction of the coat."),
             {"remaproughness", ParamKind::Bool, "true",
              "Whether roughnesses are converted to α as in other materials."}} +
             coat + maps(),
         make_coatedconductor},
        {"measured", kV4, "Rejected: measured BSDFs are not supported.", {}, nullptr},
        {"matte", kV3, "Becomes diffuse.",
         std::vector<PbrtParamInfo>{texture("Kd", "0.5", "Albedo."), sigma} + maps(), make_matte},
        {"mirror", kV3, "Becomes conductor.",
         std::vector<PbrtParamInfo>{texture("Kr", "0.9", "Reflectance.")} + maps(), make_mirror},
        {"glass", kV3, "Becomes dielectric, or roughdielectric where it is rough.",
         roughness("0") + index +
             std::vector<PbrtParamInfo>{
                 texture("Kr", "1", "Factor by which reflected light is multiplied."),
                 texture("Kt", "1", "Factor by which transmitted light is multiplied.")},
         make_glass},
        {"metal", kV3, "Becomes roughconductor.", roughness("0.01") + metal_params(), make_metal},
        {"plastic", kV3, "Becomes lobesum.",
         roughness("0.1") +
             std::vector<PbrtParamInfo>{
                 texture("Kd", "0.25", "Diffuse albedo."),
                 texture("Ks", "0.25", "Factor by which the glossy reflection is multiplied.")},
         make_plastic},
        {"substrate", kV3, "Becomes fresnelblend.",
         roughness("0.1") +
             std::vector<PbrtParamInfo>{
                 texture("Kd", "0.5", "Diffuse albedo."),
                 texture("Ks", "0.5", "Reflectance of the coat at normal incidence.")},
         make_substrate},
        {"uber", kV3, "Becomes lobesum, in a mask where opacity is below 1 (its luminance counts).",
         roughness("0.1") + index +
             std::vector<PbrtParamInfo>{
                 texture("Kd", "0.25", "Diffuse albedo."),
                 texture("Ks", "0.25", "Factor by which the glossy reflection is multiplied."),
                 texture("Kr", "0", "Factor by which the mirror reflection is multiplied."),
                 texture("Kt", "0", "Factor by which transmitted light is multiplied."),
                 texture("opacity", "1",
                         "Fraction of the light that does not pass straight through.")},
         make_uber},
        {"translucent", kV3, "Becomes lobesum; constants only.",
         roughness("0.1") +
             std::vector<PbrtParamInfo>{
                 texture("Kd", "0.25", "Diffuse albedo."), texture("Ks", "0.25", "Glossy albedo."),
                 texture("reflect", "0.5", "Fraction of the light that is reflected."),
                 texture("transmit", "0.5", "Fraction of the light that is transmitted.")},
         make_translucent},
        {"disney", kV3, "Becomes principled.",
         std::vector<PbrtParamInfo>{
             texture("color", "0.5", "Base colour."),
             texture("metallic", "0", "Weight of the metal among the base materials."),
             texture("eta", "1.5", "Index of refraction."),
             texture("roughness", "0.5", "Roughness, the root of α."),
             texture("speculartint", "0", "Tint of the specular reflection."),
             texture("anisotropic", "0", "Anisotropy."),
             texture("sheen", "0", "Sheen."),
             texture("sheentint", "0.5", "Tint of the sheen."),
             texture("clearcoat", "0", "Clear coat."),
             texture("clearcoatgloss", "1", "Gloss of the clear coat."),
             texture("spectrans", "0", "Weight of the glass among the base materials."),
             texture("scatterdistance", "", "Rejected."),
             texture("flatness", "", "Rejected."),
             texture("difftrans", "", "Rejected."),
             {"thin", ParamKind::Bool, "false", "Rejected unless false."}} +
             maps(),
         make_disney},
        {"fourier", kV3, "Rejected: measured BSDFs are not supported.", {}, nullptr},
        {"hair", kV3And4, "Rejected: there is no model of hair.", {}, nullptr},
        {"subsurface",
         kV3And4,
         "Rejected: scattering below the surface is not supported.",
         {},
         nullptr},
        {"kdsubsurface",
         kV3,
         "Rejected: scattering below the surface is not supported.",
         {},
         nullptr},
    };
}

}  // namespace

const std::vector<PbrtEntry>& pbrt_materials() {
    static const std::vector<PbrtEntry> entries = make_entries();
    return entries;
}

}  // namespace etendue
