// Materials of glTF. Metallic-roughness is `openpbr`, whose roughness is defined in the same way; extensions that
// glTF layers on it set the parameters of `openpbr` that come nearest.

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "color/metallic_color.h"
#include "readers/gltf_reader.h"

namespace etendue {
namespace {

JsonValue extension(const JsonValue& m, const char* name) {
    return m["extensions"][name];
}

Rgb colour(const JsonValue& value, Rgb fallback) {
    const std::vector<double> c = value.numbers(3, {fallback.r, fallback.g, fallback.b});
    for (const double x : c)
        if (!(x >= 0))
            value.fail(fmt::format("has the component {}, which must not be negative", x));
    return {float(c[0]), float(c[1]), float(c[2])};
}

Rgb clamped(Rgb c) {
    return {clamp(c.r, 0, 1), clamp(c.g, 0, 1), clamp(c.b, 0, 1)};
}

double transmission(const JsonValue& m) {
    return extension(m, "KHR_materials_transmission")["transmissionFactor"].number(0, 0, 1);
}

bool has_volume(const JsonValue& m) {
    return extension(m, "KHR_materials_volume")["thicknessFactor"].number(0, 0) > 0;
}

/// The index of refraction.
double ior(const JsonValue& m) {
    const double eta = extension(m, "KHR_materials_ior")["ior"].number(1.5, 0);
    // Zero is total reflection, by its specification.
    return eta == 0 ? 1e3 : std::max(eta, 1.0001);
}

}  // namespace

const GltfReader::Material& GltfReader::material(size_t index, VertexColors colors) {
    const auto key = std::pair(index, colors);
    if (const auto it = made_materials_.find(key); it != made_materials_.end()) return it->second;
    const bool is_default = index >= materials_.size();
    const Material made = read_material(
        is_default ? JsonValue(nullptr, &file_, "/materials") : materials_[index], colors);
    return made_materials_.emplace(key, made).first->second;
}

GltfReader::Material GltfReader::read_material(const JsonValue& m, VertexColors colors) {
    uv_sets_.clear();
    // Tangents are those of the first set.
    if (m["normalTexture"]) uv_set(m["normalTexture"]);
    Material made;
    if (extension(m, "KHR_materials_unlit")) {
        warn(fmt::format("{}: an unlit material is rendered as a diffuse one", m.path()));
        made.bsdf = add("bsdf", "diffuse", m);
        set_color(made.bsdf, "reflectance", base_color(m, colors));
    } else {
        made.bsdf = add("bsdf", "openpbr", m);
        read_surface(m, made.bsdf, colors);
    }
    const bool transmits = transmission(m) > 0;
    if (const JsonValue normals = m["normalTexture"]) {
        if (const int image = bitmap(normals, true); image >= 0) {
            const int map = add("bsdf", "normalmap", normals);
            add_child(map, "normalmap", image);
            if (const double scale = normals["scale"].number(1); scale != 1)
                set(map, "scale", scale);
            add_child(map, "", made.bsdf);
            made.bsdf = map;
        }
    }
    if (!transmits) {
        const int both_sides = add("bsdf", "twosided", m);
        add_child(both_sides, "", made.bsdf);
        made.bsdf = both_sides;
    } else if (has_volume(m)) {
        read_volume(m, made);
    }
    read_emission(m, made);
    apply_opacity(m, made, colors);
    if (uv_sets_.empty()) uv_sets_.push_back(0);
    made.uv_sets = uv_sets_;
    return made;
}

void GltfReader::read_surface(const JsonValue& m, int surface, VertexColors colors) {
    if (const JsonValue old = extension(m, "KHR_materials_pbrSpecularGlossiness"))
        return read_specular_glossiness(old, surface, colors);
    const JsonValue pbr = m["pbrMetallicRoughness"];
    const JsonValue metal_and_rough = pbr["metallicRoughnessTexture"];
    set_color(surface, "base_color", base_color(m, colors));
    const double metal = pbr["metallicFactor"].number(1, 0, 1);
    set_scalar(surface, "base_metalness", metal, metal_and_rough, "b");
    set(surface, "specular_ior", ior(m));
    // It is of what is not metal; `openpbr` has its colour at the edge of metal, too.
    if (const JsonValue specular = extension(m, "KHR_materials_specular");
        specular && (metal < 1 || metal_and_rough)) {
        read_specular(m, specular, surface);
    }
    const double roughness = pbr["roughnessFactor"].number(1, 0, 1);
    if (const JsonValue brushed = extension(m, "KHR_materials_anisotropy"))
        read_anisotropy(brushed, surface, roughness, metal_and_rough);
    else
        set_scalar(surface, "specular_roughness", roughness, metal_and_rough, "g");
    if (const double t = transmission(m); t > 0) {
        set_scalar(surface, "transmission_weight", t,
                   extension(m, "KHR_materials_transmission")["transmissionTexture"], "r");
        set_color(surface, "transmission_color", base_color(m, colors));
        if (!has_volume(m)) {
            set(surface, "thin_walled", true);
            if (roughness > 0.1)
                warn(fmt::format("{}: transmission without volume is clear, whatever the roughness",
                                 m.path()));
        }
    }
    if (const JsonValue coat = extension(m, "KHR_materials_clearcoat")) {
        set_scalar(surface, "coat_weight", coat["clearcoatFactor"].number(0, 0, 1),
                   coat["clearcoatTexture"], "r");
        set_scalar(surface, "coat_roughness", coat["clearcoatRoughnessFactor"].number(0, 0, 1),
                   coat["clearcoatRoughnessTexture"], "g");
        set(surface, "coat_ior", 1.5);
        // Its layers do not change each other.
        for (const char* name : {"coat_affect_ior", "coat_affect_roughness"})
            set(surface, name, 0.0);
        if (coat["clearcoatFactor"].number(0, 0, 1) > 0) check_normals_of_coat(m, coat);
    }
    if (const JsonValue cloth = extension(m, "KHR_materials_sheen")) read_sheen(cloth, surface);
}

/// The coat has the normals of what lies below.
void GltfReader::check_normals_of_coat(const JsonValue& m, const JsonValue& coat) {
    const JsonValue below = m["normalTexture"], own = coat["clearcoatNormalTexture"];
    const auto look_up = [](const JsonValue& t) {
        const JsonValue transform = t["extensions"]["KHR_texture_transform"];
        const auto numbers = [&](const char* name, double fallback) {
            return transform[name].numbers(2, {fallback, fallback});
        };
        return std::tuple(t["index"].integer(-1, 0, 1 << 30), t["texCoord"].integer(0, 0, 1000),
                          transform["texCoord"].integer(-1, 0, 1000), numbers("offset", 0),
                          numbers("scale", 1), transform["rotation"].number(0),
                          t["scale"].number(1));
    };
    if (own && below && look_up(own) == look_up(below)) return;
    if (own) warn(fmt::format("{}: has no effect", own.path()));
    if (below) warn(fmt::format("{}: the coat has this normal map, too", below.path()));
}

/// The weight sets an index of refraction, which must not bend light. So glass has it as a factor of the colour.
void GltfReader::read_specular(const JsonValue& m, const JsonValue& specular, int surface) {
    const bool bends_light = transmission(m) > 0 && has_volume(m);
    const double weight = specular["specularFactor"].number(1, 0, 1);
    Color tint{colour(specular["specularColorFactor"], Rgb(1))};
    if (!bends_light)
        set_scalar(surface, "specular_weight", weight, specular["specularTexture"], "opacity");
    else
        tint.factor = clamped(tint.factor * float(weight));
    if (tint.factor.max() > 0) {
        tint.texture = bitmap(specular["specularColorTexture"], false);
        const int share = bends_light ? bitmap(specular["specularTexture"], true, "opacity") : -1;
        if (share >= 0) tint.texture = tint.texture >= 0 ? product(tint.texture, share) : share;
    }
    set_color(surface, "specular_color", tint);
}

/// The weight of the fuzz is the largest component of the sheen's colour.
void GltfReader::read_sheen(const JsonValue& cloth, int surface) {
    const Rgb c = clamped(colour(cloth["sheenColorFactor"], Rgb(0)));
    const int texture = c.max() > 0 ? bitmap(cloth["sheenColorTexture"], false) : -1;
    if (texture >= 0) {
        for (const char* output : {"fuzz_weight", "fuzz_color"}) {
            const int part = add("texture", "sheen_to_fuzz", cloth);
            set(part, "output", std::string(output));
            set_color(part, "color", {c, texture});
            add_child(surface, output, part);
        }
    } else {
        set(surface, "fuzz_weight", double(c.max()));
        if (c.max() > 0) set(surface, "fuzz_color", c / c.max());
    }
    set_scalar(surface, "fuzz_roughness", cloth["sheenRoughnessFactor"].number(0, 0, 1),
               cloth["sheenRoughnessTexture"], "opacity");
}

/// The roughness α along the bitangent, and α + (1 − α) strength² along the tangent, by their ratio and their mean square. The
/// ratio is a number; where a texture has the roughness, its texels are taken to be kTexel.
void GltfReader::read_anisotropy(const JsonValue& brushed, int surface, double roughness,
                                 const JsonValue& texture) {
    constexpr double kTexel = 0.5;
    const double texel = texture ? kTexel : 1, typical = roughness * texel;
    const double strength = brushed["anisotropyStrength"].number(0, 0, 1),
                 across = typical * typical, along = across + (1 - across) * strength * strength,
                 mean = std::sqrt(std::sqrt((along * along + across * across) / 2));
    set_scalar(surface, "specular_roughness", mean / texel, texture, "g");
    if (texture && strength > 0)
        warn(fmt::format("{}: is approximate beside a texture of the roughness", brushed.path()));
    if (along > 0) set(surface, "specular_roughness_anisotropy", 1 - across / along);
    if (brushed["anisotropyRotation"].number(0) != 0 || brushed["anisotropyTexture"])
        warn(fmt::format("{}: the direction has no effect", brushed.path()));
}

/// Sets the parameters with which `openpbr` comes near to these colours.
void GltfReader::set_diffuse_and_specular(int surface, const Color& diffuse, const Color& specular,
                                          const JsonValue& where) {
    const MetallicColor made = metallic_color(diffuse.factor, specular.factor);
    if (specular.texture >= 0 || (diffuse.texture >= 0 && made.metallic > 0)) {
        for (const char* output : {"base_color", "metallic", "specular_weight"}) {
            const int part = add("texture", "specular_to_metallic", where);
            set(part, "output", std::string(output));
            set_color(part, "diffuse", diffuse);
            set_color(part, "specular", specular);
            add_child(surface, std::string_view(output) == "metallic" ? "base_metalness" : output,
                      part);
        }
        return;
    }
    set_color(surface, "base_color", {made.base, diffuse.texture});
    set(surface, "base_metalness", double(made.metallic));
    if (made.specular_weight < 1) set(surface, "specular_weight", double(made.specular_weight));
}

/// The older workflow: diffuse and specular colours, and the glossiness 1 - √α.
void GltfReader::read_specular_glossiness(const JsonValue& s, int surface, VertexColors colors) {
    const JsonValue both = s["specularGlossinessTexture"];
    const Color diffuse = with_vertex_colors(s["diffuseFactor"], s["diffuseTexture"], colors);
    Color specular{clamped(colour(s["specularFactor"], Rgb(1)))};
    if (specular.factor.max() > 0) specular.texture = bitmap(both, false);
    set_diffuse_and_specular(surface, diffuse, specular, s);
    const double glossiness = s["glossinessFactor"].number(1, 0, 1);
    const int gloss = bitmap(both, true, "opacity");
    if (gloss >= 0) {
        const int rough = add("texture", "mix", s);
        set(rough, "value0", 1.0);
        set(rough, "value1", 1 - glossiness);
        add_child(rough, "weight", gloss);
        add_child(surface, "specular_roughness", rough);
    } else {
        set(surface, "specular_roughness", 1 - glossiness);
    }
}

/// The base colour of metallic-roughness materials, with vertex colours.
GltfReader::Color GltfReader::base_color(const JsonValue& m, VertexColors colors) {
    const JsonValue pbr = m["pbrMetallicRoughness"];
    return with_vertex_colors(pbr["baseColorFactor"], pbr["baseColorTexture"], colors);
}

GltfReader::Color GltfReader::with_vertex_colors(const JsonValue& factor, const JsonValue& texture,
                                                 VertexColors colors) {
    const std::vector<double> f = factor.numbers(4, {1, 1, 1, 1});
    Color made{clamped({float(f[0]), float(f[1]), float(f[2])}), bitmap(texture, false)};
    if (colors != VertexColors::None) {
        const int tint = vertex_attribute("vertex_color");
        made.texture = made.texture >= 0 ? product(made.texture, tint) : tint;
    }
    return made;
}

int GltfReader::vertex_attribute(const char* name) {
    const int attribute = add("texture", "mesh_attribute", root_);
    set(attribute, "name", std::string(name));
    return attribute;
}

int GltfReader::product(int a, int b) {
    const int both = add("texture", "scale", root_);
    add_child(both, "value", a);
    add_child(both, "scale", b);
    return both;
}

void GltfReader::read_volume(const JsonValue& m, Material& made) {
    const JsonValue volume = extension(m, "KHR_materials_volume");
    const double distance = volume["attenuationDistance"].number(0, 0);
    const Rgb c = clamped(colour(volume["attenuationColor"], Rgb(1)));
    if (!(distance > 0) || c == Rgb(1)) return;
    const auto sigma = [&](float x) {
        constexpr double kDarkest = 1e-6;
        return float(-std::log(std::max(double(x), kDarkest)) / distance);
    };
    made.interior = add("medium", "homogeneous", volume);
    set(made.interior, "sigma_t", Rgb(sigma(c.r), sigma(c.g), sigma(c.b)));
    set(made.interior, "albedo", 0.0);
}

void GltfReader::read_emission(const JsonValue& m, Material& made) {
    const double strength =
        extension(m, "KHR_materials_emissive_strength")["emissiveStrength"].number(1, 0);
    const Rgb factor = colour(m["emissiveFactor"], Rgb(0)) * float(strength);
    if (factor.max() == 0) return;
    made.emitter = add("emitter", "area", m);
    const int texture = bitmap(m["emissiveTexture"], false);
    set_color(made.emitter, "radiance", {factor, texture});
    if (m["doubleSided"].flag(false)) set(made.emitter, "two_sided", true);
}

GltfReader::Alpha GltfReader::alpha(const JsonValue& m, VertexColors colors) {
    const JsonValue pbr = m["pbrMetallicRoughness"];
    const JsonValue old = extension(m, "KHR_materials_pbrSpecularGlossiness");
    Alpha a;
    a.factor = (old ? old["diffuseFactor"] : pbr["baseColorFactor"]).numbers(4, {1, 1, 1, 1})[3];
    a.texture = bitmap(old ? old["diffuseTexture"] : pbr["baseColorTexture"], false, "opacity");
    if (colors == VertexColors::Rgba) {
        const int vertices = vertex_attribute("vertex_alpha");
        a.texture = a.texture >= 0 ? product(a.texture, vertices) : vertices;
    }
    return a;
}

void GltfReader::apply_opacity(const JsonValue& m, Material& made, VertexColors colors) {
    const std::string mode = m["alphaMode"].text("OPAQUE");
    if (mode == "OPAQUE") return;
    if (mode != "MASK" && mode != "BLEND")
        m["alphaMode"].fail(fmt::format("is \"{}\", but must be OPAQUE, MASK or BLEND", mode));
    const double cutoff = m["alphaCutoff"].number(0.5, 0);
    const auto [texture, factor] = alpha(m, colors);
    int opacity = -1;
    if (texture >= 0) {
        opacity = factor == 1 ? texture : scaled(texture, factor);
        if (mode == "MASK") {
            const int threshold = add("texture", "threshold", m);
            set(threshold, "cutoff", cutoff);
            add_child(threshold, "value", opacity);
            opacity = threshold;
        }
    }
    const double constant =
        std::clamp(mode == "BLEND" ? factor : double(factor >= cutoff), 0.0, 1.0);
    if (opacity < 0 && constant == 1) return;
    if (opacity < 0 && constant == 0) made.emitter = -1;
    const int mask = add("bsdf", "mask", m);
    if (opacity >= 0)
        add_child(mask, "opacity", opacity);
    else
        set(mask, "opacity", constant);
    add_child(mask, "", made.bsdf);
    made.bsdf = mask;
}

// ---- Textures

namespace {

std::string wrapping(const JsonValue& mode) {
    constexpr int64_t kClamp = 33071, kMirror = 33648, kRepeat = 10497;
    switch (const int64_t code = mode.integer(kRepeat, 0, 1 << 20)) {
    case kRepeat: return "repeat";
    case kClamp: return "clamp";
    case kMirror: return "mirror";
    default:
        mode.fail(fmt::format("is {}, but must be 33071 (clamp), 33648 (mirror) or 10497 (repeat)",
                              code));
    }
}

}  // namespace

int GltfReader::uv_set(const JsonValue& info) {
    const JsonValue transform = info["extensions"]["KHR_texture_transform"];
    const auto own = info["texCoord"].integer(0, 0, 1000);
    const auto set = size_t(transform["texCoord"].integer(own, 0, 1000));
    const auto it = std::find(uv_sets_.begin(), uv_sets_.end(), set);
    if (it != uv_sets_.end()) return int(it - uv_sets_.begin());
    constexpr size_t kMost = 2;
    if (uv_sets_.size() == kMost) {
        reject(info, fmt::format("a material whose textures use more than {} sets of texture "
                                 "coordinates ({}, {} and {}) is not supported",
                                 kMost, uv_sets_[0], uv_sets_[1], set));
        return 0;
    }
    uv_sets_.push_back(set);
    return int(uv_sets_.size()) - 1;
}

int GltfReader::bitmap(const JsonValue& info, bool raw, const char* channel) {
    if (!info) return -1;
    const auto index = info["index"].index(textures_.size());
    if (!index) info["index"].fail("is missing");
    const int set_of_uvs = uv_set(info);
    const JsonValue& t = textures_[*index];
    const auto source = t["source"].index(images_.size());
    if (!source) {
        reject(t, "a texture without an image of PNG or JPEG");
        return -1;
    }
    const JsonValue& image = images_[*source];
    const int made = add("texture", "bitmap", info);
    const std::string uri = image["uri"].text("");
    if (!uri.empty() && uri.rfind("data:", 0) != 0) {
        set(made, "filename", decode_percent(uri));
    } else {
        const auto [at, is_new] =
            loaded_images_.try_emplace(*source, int64_t(scene_.images.size()));
        if (is_new) {
            const auto view = image["bufferView"].index(buffers_.view_count());
            if (!view && uri.empty()) image.fail("has neither a uri nor a bufferView");
            watch(view ? buffers_.view(*view).size() : uri.size(), image);
            scene_.images.push_back(EncodedImage{fmt::format("{}{}", file_.str(), image.path()),
                                                 view ? std::string(buffers_.view(*view))
                                                      : buffers_.uri(image["uri"])});
        }
        set(made, "image", at->second);
    }
    if (set_of_uvs != 0) set(made, "uv_set", int64_t(set_of_uvs));
    if (raw) set(made, "raw", true);
    if (channel && std::string_view(channel) != "all") set(made, "channel", std::string(channel));
    if (const auto sampler = t["sampler"].index(samplers_.size())) {
        const JsonValue& s = samplers_[*sampler];
        constexpr int64_t kNearest = 9728;
        if (s["magFilter"].integer(0, 0, 1 << 20) == kNearest)
            set(made, "filter_type", std::string("nearest"));
        const std::string u = wrapping(s["wrapS"]), v = wrapping(s["wrapT"]);
        if (u != "repeat") set(made, "wrap_mode", u);
        if (v != u) set(made, "wrap_mode_v", v);
    }
    if (const JsonValue transform = info["extensions"]["KHR_texture_transform"]) {
        const std::vector<double> offset = transform["offset"].numbers(2, {0, 0}),
                                  scale = transform["scale"].numbers(2, {1, 1});
        const double angle = transform["rotation"].number(0), c = std::cos(angle),
                     s = std::sin(angle);
        set(made, "to_uv",
            Transform(Transform::Matrix{{{c * scale[0], s * scale[1], 0, offset[0]},
                                         {-s * scale[0], c * scale[1], 0, offset[1]},
                                         {0, 0, 1, 0},
                                         {0, 0, 0, 1}}}));
    }
    return made;
}

int GltfReader::scaled(int texture, ParamValue factor) {
    const int product = add("texture", "scale", root_);
    add_child(product, "value", texture);
    set(product, "scale", std::move(factor));
    return product;
}

void GltfReader::set_color(int object, const char* name, const Color& color) {
    if (color.texture < 0)
        set(object, name, color.factor);
    else
        add_child(object, name,
                  color.factor == Rgb(1) ? color.texture : scaled(color.texture, color.factor));
}

void GltfReader::set_scalar(int object, const char* name, double factor, const JsonValue& texture,
                            const char* channel, bool raw) {
    const int image = factor > 0 ? bitmap(texture, raw, channel) : -1;
    if (image < 0)
        set(object, name, factor);
    else
        add_child(object, name, factor == 1 ? image : scaled(image, factor));
}

}  // namespace etendue
