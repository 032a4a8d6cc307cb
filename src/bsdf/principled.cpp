// Disney's principled BSDF [Burley 2012, 2015] in the form of Mitsuba 3, with the exact Fresnel
// equations for the dielectric part and without subsurface scattering.
//   base_color (0.5)       colour or texture in [0, 1]
//   roughness (0.5)        square root of the main specular lobe's α
//   anisotropic (0)        highlights stretched along ∂p/∂u
//   metallic (0), spec_trans (0)   share of metal; share of rough glass in the rest
//   eta, or specular (0.5) index below over index above, or the reflectance at normal incidence
//                          in units of 0.08; one of the two
//   spec_tint (0)          share of the dielectric reflection that takes the hue of the base colour
//   sheen (0), sheen_tint (0)      retroreflective cloth at grazing angles, and its hue
//   flatness (0)           share of fake subsurface scattering in the diffuse part
//   clearcoat (0), clearcoat_gloss (0)   second, isotropic specular lobe, and its sharpness
//   specular_weight (1), specular_color (1)   factors of the reflectance at normal incidence of what is not metal; of
//                          the colour the luminance counts. An index of refraction with this reflectance replaces eta.
// All of them may be textures, except eta and specular. From below, the surface is rough glass only.
//
// Reflection is reciprocal. Energy is not conserved: specular reflection is added to the diffuse part without reducing
// it, so that the albedo of white materials exceeds one, as in Burley's model.

#include "bsdf/principled.h"

#include <algorithm>

#include <fmt/format.h>

#include "bsdf/fresnel.h"
#include "bsdf/material.h"
#include "math/warp.h"

namespace etendue {
namespace {

/// Schlick's (1 − cos θ)⁵.
float schlick_weight(float cos) {
    const float m = clamp(1 - cos, 0, 1);
    return sqr(sqr(m)) * m;
}

/// Schlick's Fresnel reflectance for light from above, with the angle on the side of the smaller index.
Rgb schlick(Rgb R0, float cos_m, float eta) {
    const float cos = eta > 1 ? cos_m : std::fabs(fresnel_dielectric(cos_m, eta).cos_t);
    return lerp(schlick_weight(cos), R0, Rgb(1));
}

/// GTR1 distribution of normals of the clearcoat [Burley 2012, app. B]; sin² replaces 1 − cos², which would cancel.
struct Gtr1 {
    float alpha2;

    float D(Vec3 m) const {
        return (1 - alpha2) * kInvPi /
               (-std::log(alpha2) * (sqr(m.x) + sqr(m.y) + alpha2 * sqr(m.z)));
    }
    float pdf(Vec3 m) const { return D(m) * m.z; }
    Vec3 sample(Vec2 u) const {
        const float sin2 = (std::pow(alpha2, 1 - u.y) - alpha2) / (1 - alpha2);
        float s, c;
        sincosf(2 * kPi * u.x, &s, &c);
        const float r = safe_sqrt(sin2);
        return {r * c, r * s, safe_sqrt(1 - sin2)};
    }
};

/// α from 0.1 (dull) to 0.001; masking and shadowing have a fixed α of their own [Burley 2012,
/// §5.6].
float clearcoat_alpha(float gloss) {
    return lerp(gloss, 0.1f, 0.001f);
}
constexpr float kClearcoatMaskingAlpha = 0.25f;
constexpr float kClearcoatR0 = 0.04f;

}  // namespace

Microfacet PrincipledLobe::main_distribution() const {
    constexpr float kSharpest = 0.001f;
    const float alpha = sqr(surface_roughness), aspect = std::sqrt(1 - 0.9f * anisotropic);
    return {Microfacet::Kind::Ggx, std::max(alpha / aspect, kSharpest),
            std::max(alpha * aspect, kSharpest)};
}

float PrincipledLobe::roughness() const {
    const float main = main_distribution().min_alpha();
    return clearcoat > 0 ? std::min(main, clearcoat_alpha(clearcoat_gloss)) : main;
}

PrincipledLobe::Selection PrincipledLobe::selection() const {
    const float d = diffuse_weight(), c = 0.25f * clearcoat, m = has_main() ? 1.0f : 0.0f;
    const float total = m + d + c;
    return {d / total, c / total, m / total};
}

float PrincipledLobe::reflection_probability(bool is_above, float F) const {
    return is_above ? 1 - refraction_weight() * (1 - F) : F;
}

/// The base colour's hue at luminance one.
Rgb PrincipledLobe::tint() const {
    const float lum = luminance(base_color);
    return lum > 0 ? base_color / lum : Rgb(1);
}

/// The Fresnel term of the main reflection: Schlick's for metal and for the tinted share of the
/// dielectric.
Rgb PrincipledLobe::specular_color(bool is_above, float cos_m, float F) const {
    if (!is_above) return Rgb(refraction_weight() * F);
    Rgb color((1 - metallic) * (1 - spec_tint) * F);
    if (metallic > 0) color += schlick(base_color, cos_m, eta) * metallic;
    if (spec_tint > 0) {
        const float R0 = sqr((eta - 1) / (eta + 1));
        color += schlick(tint() * R0, cos_m, eta) * ((1 - metallic) * spec_tint);
    }
    return color;
}

/// Diffuse reflection with retroreflection [Burley 2015], the Hanrahan-Krueger lookalike of
/// subsurface scattering [Burley 2012, §5.3], and sheen.
Rgb PrincipledLobe::diffuse_and_sheen(Vec3 wo, Vec3 wi, float cos_m) const {
    const float Fo = schlick_weight(wo.z), Fi = schlick_weight(wi.z);
    const float retro = 2 * surface_roughness * sqr(cos_m);
    float f = (1 - 0.5f * Fo) * (1 - 0.5f * Fi) + retro * (Fo + Fi + Fo * Fi * (retro - 1));
    if (flatness > 0) {
        const float Fss90 = 0.5f * retro;
        const float Fss = lerp(Fo, 1, Fss90) * lerp(Fi, 1, Fss90);
        f = lerp(flatness, f, 1.25f * (Fss * (1 / (wo.z + wi.z) - 0.5f) + 0.5f));
    }
    Rgb color = base_color * (diffuse_weight() * kInvPi * f);
    if (sheen > 0)
        color +=
            lerp(sheen_tint, Rgb(1), tint()) * (sheen * (1 - metallic) * schlick_weight(cos_m));
    return color;
}

BsdfEval PrincipledLobe::eval_reflection(Vec3 wo, Vec3 wi) const {
    const bool is_above = wo.z > 0;
    const Vec3 h = is_above ? wo + wi : -(wo + wi), m = h / length(h);
    if (!(m.z > 0)) return {};  // opposite grazing directions: not resolved by float
    const float cos_m = dot(wo, m), F = fresnel_dielectric(cos_m, eta).R;
    const Microfacet main = main_distribution();
    const float quarter_D = 0.25f * main.D(m), sigma_o = main.sigma(wo), sigma_i = main.sigma(wi);

    const float main_reflection = reflection_probability(is_above, F) * quarter_D;
    BsdfEval e{.f = specular_color(is_above, cos_m, F) *
                    (quarter_D * std::fabs(wi.z) / (sigma_o * sigma_i)),
               .pdf = main_reflection / sigma_o,
               .pdf_rev = main_reflection / sigma_i};
    if (!is_above) return e;

    const Selection p = selection();
    e.f += diffuse_and_sheen(wo, wi, cos_m) * wi.z;
    e.pdf = p.main * e.pdf + p.diffuse * wi.z * kInvPi;
    e.pdf_rev = p.main * e.pdf_rev + p.diffuse * wo.z * kInvPi;
    if (clearcoat > 0) {
        const Gtr1 coat{sqr(clearcoat_alpha(clearcoat_gloss))};
        const Microfacet masking(Microfacet::Kind::Ggx, kClearcoatMaskingAlpha,
                                 kClearcoatMaskingAlpha);
        const float coat_pdf = p.clearcoat * coat.pdf(m) / (4 * cos_m);
        e.f += schlick(Rgb(kClearcoatR0), cos_m, eta) *
               (0.25f * clearcoat * coat.D(m) * masking.G1(wo) * masking.G1(wi) * wi.z);
        e.pdf += coat_pdf;
        e.pdf_rev += coat_pdf;
    }
    return e;
}

/// As RoughDielectricLobe's refraction, tinted by √base_color, since light passes the boundary twice.
BsdfEval PrincipledLobe::eval_refraction(Vec3 wo, Vec3 wi) const {
    const bool is_above = wo.z > 0;
    const float eta_io = is_above ? eta : 1 / eta;
    Vec3 m = normalize(wo + wi * eta_io);
    if (m.z < 0) m = -m;
    const float cos_o = dot(wo, m), cos_i = dot(wi, m);
    if (!(cos_o * wo.z > 0 && cos_i * wi.z > 0)) return {};
    // Evaluated on the side of the smaller index, where F is smooth; both sides have the same F.
    const float F = fresnel_dielectric(eta_io > 1 ? cos_o : cos_i, eta).R;
    const Microfacet main = main_distribution();
    const float sigma_o = main.sigma(wo), sigma_i = main.sigma(wi);

    const float facets = main.D(m) * std::fabs(cos_o * cos_i) / sqr(cos_o + eta_io * cos_i);
    const float p_main = selection().main;
    const float p_o = (is_above ? p_main : 1) * (1 - reflection_probability(is_above, F));
    const float p_i = (is_above ? 1 : p_main) * (1 - reflection_probability(!is_above, F));
    const float value = (1 - F) * refraction_weight() * facets * sqr(eta_io) * std::fabs(wi.z) /
                        (sigma_o * sigma_i);
    return {.f = sqrt(base_color) * value,
            .pdf = p_o * facets * sqr(eta_io) / sigma_o,
            .pdf_rev = p_i * facets / sigma_i,
            .eta = eta_io};
}

BsdfEval PrincipledLobe::eval(Vec3 wo, Vec3 wi) const {
    const bool has_refraction = refraction_weight() > 0;
    if (wo.z * wi.z > 0 && (wo.z > 0 || has_refraction)) return eval_reflection(wo, wi);
    if (wo.z * wi.z < 0 && has_refraction) return eval_refraction(wo, wi);
    return {};
}

float PrincipledLobe::max_pdf(Vec3 wo, const DirectionCone& c) const {
    const bool is_above = wo.z > 0;
    const Vec3 own{0, 0, is_above ? 1.0f : -1.0f};
    const Microfacet main = main_distribution();
    const Selection p = is_above ? selection() : Selection{0, 0, 1};
    const float max_cos = c.max_cos(own);
    float bound = 0;
    if (max_cos > 0) {
        bound = p.main * main.max_pdf_of_reflection(wo, c) + p.diffuse * max_cos * kInvPi;
        if (p.clearcoat > 0) {
            const HalfwayBound h = halfway_of_reflection(wo, c);
            const Gtr1 coat{sqr(clearcoat_alpha(clearcoat_gloss))};
            const float theta = clamp(h.theta, 0.0f, 0.5f * kPi);
            bound += p.clearcoat * coat.D({std::sin(theta), 0, std::cos(theta)}) * std::cos(theta) /
                     (4 * h.cos_d);
        }
    }
    if (refraction_weight() > 0 && c.max_cos(-own) > 0) {
        const float share = is_above ? refraction_weight() : 1.0f;
        bound = std::fmax(bound, p.main * share *
                                     main.max_pdf_of_refraction(wo, c, is_above ? eta : 1 / eta));
    }
    return bound;
}

std::optional<BsdfSample> PrincipledLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    const bool is_above = wo.z > 0;
    if (!is_above && !(wo.z < 0 && refraction_weight() > 0)) return {};

    const auto reflected = [&](Vec3 wi) {
        return wi.z * wo.z > 0 ? make_sample(wi, eval_reflection(wo, wi)) : std::nullopt;
    };
    if (is_above) {
        const Selection p = selection();
        if (u_lobe < p.diffuse || !(p.main + p.clearcoat > 0))
            return reflected(sample_cosine_hemisphere(u));
        u_lobe -= p.diffuse;
        if (u_lobe < p.clearcoat || !(p.main > 0))
            return reflected(
                normalize(reflect(wo, Gtr1{sqr(clearcoat_alpha(clearcoat_gloss))}.sample(u))));
        u_lobe = (u_lobe - p.clearcoat) / p.main;
    }
    const Vec3 m = main_distribution().sample_visible(is_above ? wo : -wo, u);
    const DielectricFresnel fresnel = fresnel_dielectric(dot(wo, m), eta);
    if (u_lobe < reflection_probability(is_above, fresnel.R))
        return reflected(normalize(reflect(wo, m)));
    const Vec3 wi = normalize(refract(wo, m, fresnel));
    return wi.z * wo.z < 0 ? make_sample(wi, eval_refraction(wo, wi)) : std::nullopt;
}

namespace {

class Principled final : public Material {
public:
    Principled(const Params& params, MaterialContext& context)
        : base_color_(context.texture(params, "base_color", Rgb(0.5f), 1)),
          roughness_(context.texture(params, "roughness", Rgb(0.5f), 1)),
          anisotropic_(context.texture(params, "anisotropic", Rgb(0), 1)),
          metallic_(context.texture(params, "metallic", Rgb(0), 1)),
          spec_trans_(context.texture(params, "spec_trans", Rgb(0), 1)),
          spec_tint_(context.texture(params, "spec_tint", Rgb(0), 1)),
          sheen_(context.texture(params, "sheen", Rgb(0), 1)),
          sheen_tint_(context.texture(params, "sheen_tint", Rgb(0), 1)),
          flatness_(context.texture(params, "flatness", Rgb(0), 1)),
          clearcoat_(context.texture(params, "clearcoat", Rgb(0), 1)),
          clearcoat_gloss_(context.texture(params, "clearcoat_gloss", Rgb(0), 1)),
          specular_weight_(context.texture(params, "specular_weight", Rgb(1), 1)),
          specular_color_(context.texture(params, "specular_color", Rgb(1))),
          has_own_reflectance_(!is_one(specular_weight_) || !is_one(specular_color_)),
          eta_(read_eta(params)) {
        if (is_transmissive() && eta_ == 1) eta_ = kEtaOfClearGlass;
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const auto scalar = [&](const TextureRef& texture) {
            return texture.eval_scalar(point.texture_point());
        };
        PrincipledLobe lobe{.base_color = base_color_.eval(point.texture_point()),
                            .surface_roughness = scalar(roughness_),
                            .anisotropic = scalar(anisotropic_),
                            .metallic = scalar(metallic_),
                            .spec_trans = scalar(spec_trans_),
                            .eta = eta_,
                            .spec_tint = scalar(spec_tint_),
                            .sheen = scalar(sheen_),
                            .sheen_tint = scalar(sheen_tint_),
                            .flatness = scalar(flatness_),
                            .clearcoat = scalar(clearcoat_),
                            .clearcoat_gloss = scalar(clearcoat_gloss_)};
        if (has_own_reflectance_) lobe.eta = own_eta(point, lobe.spec_trans > 0);
        list.add(frame, lobe, weight);
    }
    bool is_transmissive() const override {
        return !spec_trans_.is_constant() || spec_trans_.eval_scalar(Vec2()) > 0;
    }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override { return base_color_.mean(); }

private:
    static bool is_one(const TextureRef& texture) {
        return texture.is_constant() && texture.eval(TexturePoint()) == Rgb(1);
    }
    static constexpr float kLargestR0 = 0.98f;
    /// Replaces η = 1, where refraction would be a delta event, as in Mitsuba 3.
    static constexpr float kEtaOfClearGlass = 1.001f;

    static float read_eta(const Params& params) {
        if (params.has("eta") && params.has("specular"))
            params.fail("specular", "give either \"eta\" or \"specular\", not both");
        if (params.has("eta")) {
            const float eta = params.number("eta", 1.5f, 0);
            if (!(eta > 0))
                params.fail("eta",
                            fmt::format("parameter \"eta\" is {}, but must be above 0", eta));
            return eta;
        }
        // F0 = 0.08 specular.
        return 2 / (1 - std::sqrt(0.08f * params.number("specular", 0.5f, 0, 1))) - 1;
    }

    /// The index of refraction with the reflectance at normal incidence that is given; 1 reflects nothing.
    float own_eta(const SurfacePoint& point, bool transmits) const {
        const float weight = specular_weight_.eval_scalar(point.texture_point());
        const float factor = weight * specular_color_.eval_scalar(point.texture_point());
        const float root = std::sqrt(std::min(sqr((eta_ - 1) / (eta_ + 1)) * factor, kLargestR0));
        const float eta = std::max((1 + root) / (1 - root), transmits ? kEtaOfClearGlass : 1.0f);
        return eta_ < 1 ? 1 / eta : eta;
    }

    TextureRef base_color_, roughness_, anisotropic_, metallic_, spec_trans_, spec_tint_, sheen_,
        sheen_tint_, flatness_, clearcoat_, clearcoat_gloss_, specular_weight_, specular_color_;
    bool has_own_reflectance_;
    float eta_;
};

}  // namespace

MaterialEntry principled_entry() {
    return {
        {"bsdf",
         "principled",
         "Disney's principled BSDF [Burley 2012, 2015] as in Mitsuba 3.",
         {{"base_color", ParamKind::Texture, "0.5",
           "Colour of the diffuse part, of metal and of glass, in [0, 1]."},
          {"roughness", ParamKind::Texture, "0.5",
           "Square root of the main specular lobe's alpha, in [0, 1]."},
          {"anisotropic", ParamKind::Texture, "0",
           "Stretches highlights along the u direction, in [0, 1]."},
          {"metallic", ParamKind::Texture, "0", "Fraction of metal, in [0, 1]."},
          {"spec_trans", ParamKind::Texture, "0",
           "Fraction of rough glass in the part that is not metal, in [0, 1]."},
          {"eta", ParamKind::Float, "",
           "Index of refraction below the surface divided by that above it; instead of specular."},
          {"specular", ParamKind::Float, "0.5",
           "Reflectance at normal incidence divided by 0.08, in [0, 1]."},
          {"spec_tint", ParamKind::Texture, "0",
           "Fraction of the base colour in the dielectric reflection, in [0, 1]."},
          {"sheen", ParamKind::Texture, "0", "Strength of the sheen of cloth, in [0, 1]."},
          {"sheen_tint", ParamKind::Texture, "0",
           "Fraction of the base colour in the sheen, in [0, 1]."},
          {"flatness", ParamKind::Texture, "0",
           "Fraction of approximate subsurface scattering, in [0, 1]."},
          {"clearcoat", ParamKind::Texture, "0",
           "Strength of the second specular lobe, in [0, 1]."},
          {"clearcoat_gloss", ParamKind::Texture, "0",
           "Sharpness of the second specular lobe, in [0, 1]."},
          {"specular_weight", ParamKind::Texture, "1",
           "Factor of the reflectance at normal incidence of what is not metal, in [0, 1]."},
          {"specular_color", ParamKind::Texture, "1",
           "Another factor of it, which may exceed 1; of colours the luminance."}}},
        make_material<Principled>};
}

}  // namespace etendue
