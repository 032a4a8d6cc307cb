#include "bsdf/ior.h"

#include <algorithm>

#include <fmt/format.h>

#include "color/metals.h"

namespace etendue {
namespace {

struct NamedIor {
    const char* name;
    float ior;
};

/// At about 589 nm and room temperature; values and names as in Mitsuba's documentation, so that
/// scenes carry over.
constexpr NamedIor kNamedIors[] = {
    {"vacuum", 1.0f},
    {"helium", 1.000036f},
    {"hydrogen", 1.000132f},
    {"air", 1.000277f},
    {"carbon dioxide", 1.00045f},
    {"water ice", 1.31f},
    {"water", 1.333f},
    {"acetone", 1.36f},
    {"ethanol", 1.361f},
    {"fused quartz", 1.458f},
    {"carbon tetrachloride", 1.461f},
    {"pyrex", 1.47f},
    {"glycerol", 1.4729f},
    {"acrylic glass", 1.49f},
    {"polypropylene", 1.49f},
    {"benzene", 1.501f},
    {"bk7", 1.5046f},
    {"silicone oil", 1.52045f},
    {"sodium chloride", 1.544f},
    {"amber", 1.55f},
    {"pet", 1.575f},
    {"bromine", 1.661f},
    {"diamond", 2.419f},
};

/// Far beyond any metal; larger indices overflow in the Fresnel equations.
constexpr float kMaxConductorIndex = 1e4f;
/// The same of dielectrics.
constexpr float kMaxIor = 1e6f;

float named_ior(const Params& params, const char* parameter, const std::string& name) {
    const auto it = std::find_if(std::begin(kNamedIors), std::end(kNamedIors),
                                 [&](const NamedIor& n) { return name == n.name; });
    if (it != std::end(kNamedIors)) return it->ior;
    std::vector<std::string> names;
    for (const NamedIor& n : kNamedIors) names.push_back(n.name);
    params.fail(parameter,
                fmt::format("parameter \"{}\" is \"{}\", but must be a number or one of: {}",
                            parameter, name, fmt::join(names, ", ")));
}

}  // namespace

float read_ior(const Params& params, const char* name, const char* fallback) {
    const Param* p = params.object().find(name);
    if (!p || p->type() == ParamType::String)
        return named_ior(params, name, params.text(name, fallback));
    const float ior = params.number(name, 1, 0, kMaxIor);
    if (!(ior > 0))
        params.fail(name, fmt::format("parameter \"{}\" is {}, but must be above 0", name, ior));
    return ior;
}

float read_relative_ior(const Params& params) {
    return read_ior(params, "int_ior", "bk7") / read_ior(params, "ext_ior", "air");
}

ConductorIndex::ConductorIndex(const Params& params, MaterialContext& context) {
    read(params, context);
    if (!params.has("ext_eta")) return;
    if (!eta.is_constant() || !k.is_constant())
        params.fail("ext_eta", "\"ext_eta\" needs \"eta\" and \"k\" that are not textures");
    const float outside = read_ior(params, "ext_eta", "air");
    eta = TextureRef(eta.mean() / outside);
    k = TextureRef(k.mean() / outside);
}

void ConductorIndex::read(const Params& params, MaterialContext& context) {
    const std::string name = params.text("material", "none");
    const bool has_index = params.has("eta") || params.has("k");
    if (name != "none") {
        if (has_index)
            params.fail("material", "give either \"material\", or \"eta\" and \"k\", not both");
        const std::optional<ConductorIor> metal = named_metal(name);
        if (!metal) {
            const std::string near = nearest_name(name, metal_names());
            params.fail(
                "material",
                fmt::format("parameter \"material\" is \"{}\", which is not a known metal{}", name,
                            near.empty()
                                ? fmt::format(" (known: none, {})", fmt::join(metal_names(), ", "))
                                : fmt::format(" (did you mean \"{}\"?)", near)));
        }
        eta = metal->eta;
        k = metal->k;
        return;
    }
    // η = 0, k = 1 reflects everything.
    eta = context.texture(params, "eta", Rgb(0), kMaxConductorIndex);
    k = context.texture(params, "k", Rgb(1), kMaxConductorIndex);
}

Roughness::Roughness(const Params& params, MaterialContext& context)
    : kind_(read_distribution(params)) {
    const bool is_anisotropic = params.has("alpha_u") || params.has("alpha_v");
    if (is_anisotropic && params.has("alpha"))
        params.fail("alpha", "give either \"alpha\", or \"alpha_u\" and \"alpha_v\", not both");
    if (params.has("alpha_u") != params.has("alpha_v"))
        params.fail("\"alpha_u\" and \"alpha_v\" must be given together");
    alpha_u_ = context.texture(params, is_anisotropic ? "alpha_u" : "alpha", Rgb(0.1f));
    alpha_v_ = is_anisotropic ? context.texture(params, "alpha_v", Rgb(0.1f)) : alpha_u_;
}

Microfacet::Kind read_distribution(const Params& params) {
    return params.choice("distribution", {"beckmann", "ggx"}, 0) == 0 ? Microfacet::Kind::Beckmann
                                                                      : Microfacet::Kind::Ggx;
}

std::vector<ParamInfo> dielectric_params() {
    return {
        {"int_ior", ParamKind::FloatOrName, "bk7",
         "Index of refraction behind the surface, above 0."},
        {"ext_ior", ParamKind::FloatOrName, "air", "Index of refraction in front of it, above 0."},
        {"specular_reflectance", ParamKind::Texture, "1", "Factor on the reflection."},
        {"specular_transmittance", ParamKind::Texture, "1", "Factor on the transmission."}};
}

std::vector<ParamInfo> conductor_params() {
    return {{"material", ParamKind::String, "none",
             "Named metal (Au, Cu, Ag, ...), or none for a perfect mirror."},
            {"eta", ParamKind::Texture, "0",
             "Real part of the index of refraction relative to the outside."},
            {"ext_eta", ParamKind::FloatOrName, "1",
             "Index of refraction of the outside, by which eta and k are divided."},
            {"k", ParamKind::Texture, "1",
             "Imaginary part of the index of refraction relative to the outside."},
            {"specular_reflectance", ParamKind::Texture, "1", "Factor on the reflectance."}};
}

std::vector<ParamInfo> roughness_params() {
    return {{"distribution", ParamKind::String, "beckmann",
             "Distribution of facet normals: beckmann or ggx."},
            {"alpha", ParamKind::Texture, "0.1",
             "Roughness: RMS slope of the facets, clamped to [0.0001, 100]."},
            {"alpha_u", ParamKind::Texture, "",
             "Roughness along the first tangent; together with alpha_v, instead of alpha."},
            {"alpha_v", ParamKind::Texture, "", "Roughness along the second tangent."},
            {"sample_visible", ParamKind::Bool, "true",
             "Accepted; visible normals are always sampled."}};
}

}  // namespace etendue
