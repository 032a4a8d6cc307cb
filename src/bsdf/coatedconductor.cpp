// Metal below a clear or absorbing dielectric coat, like `coatedconductor` of pbrt-v4, in closed form.
//   distribution (beckmann)              beckmann or ggx; of the metal and of the coat
//   alpha (0.1), or alpha_u, alpha_v     roughness of the metal; 0 is smooth
//   coat_alpha (0)                       roughness of the coat; 0 is smooth
//   material (none), or eta, k           named metal, "none" for reflectance 1, or its complex index
//   reflectance                          instead of these: the metal's reflectance at normal incidence in air
//   int_ior (bk7), ext_ior (air)         indices of the coat and outside
//   thickness (0)                        optical thickness of the coat: thickness times absorption coefficient
// Exact for a smooth coat over a smooth metal. A rough metal below a smooth coat: exact for light reflected once by the
// metal; further interreflections continue in the same lobe, and light that meets the coat beyond the critical angle is
// lost. Of what GGX copper reflects, these are at most 9 % with α = 0.05, and 25 % with α = 0.4. A rough coat refracts as a smooth one does, with the transmittance of a rough one, and widens the lobe of the
// metal: facets of slope s turn refracted light by (1 − 1/η) s, twice, and the metal's facets by 2s, so the squares of
// the roughnesses add as α² + (1 − 1/η)² α_coat² / 2. Reciprocal; loses energy but never gains any. One-sided.

#include "bsdf/coatedconductor.h"

#include "bsdf/ior.h"
#include "bsdf/material.h"

namespace etendue {

BsdfEval CoatedConductorLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    const float To = T(wo.z), Ti = T(wi.z);
    const Vec3 o = below(wo), i = below(wi), m = normalize(o + i);
    // As for a RoughConductorLobe between o and i. With cos θi dωi = η² cos θ'i dω'i the densities change by
    // cos θi / (η² cos θ'i), and so does f |cos θi|.
    const float quarter_D = 0.25f * metal.D(m), sigma_o = metal.sigma(o), sigma_i = metal.sigma(i);
    const float to_outside = 1 / sqr(eta);
    const float pdf = quarter_D / sigma_o * (to_outside * wi.z / i.z),
                pdf_rev = quarter_D / sigma_i * (to_outside * wo.z / o.z);
    const Rgb R = coated_reflectance(fresnel_conductor(dot(o, m), metal_eta, metal_k), To, Ti,
                                     coat_attenuation(thickness, o.z, i.z));
    BsdfEval e{.f = R * (pdf * (i.z / sigma_i)), .pdf = To * pdf, .pdf_rev = Ti * pdf_rev};
    if (!transmittance) return e;
    const Vec3 h = wo + wi, mc = h / length(h);
    if (!(mc.z > 0)) return e;  // opposite grazing directions: not resolved by float
    const Microfacet facets = coat();
    const float quarter_Dc = 0.25f * facets.D(mc), sigma_co = facets.sigma(wo),
                sigma_ci = facets.sigma(wi);
    const float F = fresnel_dielectric(dot(wo, mc), eta).R;
    e.f += Rgb(F * quarter_Dc * wi.z / (sigma_co * sigma_ci));
    e.pdf += (1 - To) * quarter_Dc / sigma_co;
    e.pdf_rev += (1 - Ti) * quarter_Dc / sigma_ci;
    return e;
}

std::optional<BsdfSample> CoatedConductorLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (!(wo.z > 0)) return {};
    if (u_lobe < 1 - T(wo.z)) {
        if (!transmittance) return delta_event(wo, false);
        const Vec3 wi = normalize(reflect(wo, coat().sample_visible(wo, u)));
        return make_sample(wi, eval(wo, wi));
    }
    const Vec3 o = below(wo), i = reflect(o, metal.sample_visible(o, u));
    const float sin2 = sqr(eta) * (sqr(i.x) + sqr(i.y));
    if (!(i.z > 0 && sin2 < 1)) return {};
    const Vec3 wi = normalize(Vec3{i.x * eta, i.y * eta, std::sqrt(1 - sin2)});
    return make_sample(wi, eval(wo, wi));
}

std::optional<BsdfSample> CoatedConductorLobe::delta_event(Vec3 wo, bool transmits) const {
    if (!(wo.z > 0) || transmits || transmittance) return {};
    const float F = fresnel_dielectric(wo.z, eta).R;
    if (!(F > 0)) return {};
    return BsdfSample{
        .wi = reflect(wo), .weight = Rgb(1), .pdf = F, .pdf_rev = F, .is_delta = true};
}

float CoatedConductorLobe::max_pdf(Vec3 wo, const DirectionCone& c) const {
    if (!(wo.z > 0)) return 0;
    // Refraction into the coat contracts distances between directions above it, and cos θi <= cos θ'i.
    const DirectionCone inside =
        c.axis.z > 0 ? DirectionCone{below(c.axis), c.angle} : DirectionCone{Vec3{0, 0, 1}, kPi};
    const float To = T(wo.z);
    float bound = To * metal.max_pdf_of_reflection(below(wo), inside) / sqr(eta);
    if (transmittance) bound += (1 - To) * coat().max_pdf_of_reflection(wo, c);
    return bound;
}

Rgb CoatedConductorLobe::albedo_estimate() const {
    const float t = T(1);
    return Rgb(1 - t) + coated_reflectance(fresnel_conductor(1, metal_eta, metal_k), t, t,
                                           coat_attenuation(thickness, 1, 1));
}

namespace {

class CoatedConductor final : public Material {
public:
    CoatedConductor(const Params& params, MaterialContext& context)
        : roughness_(params, context), ior_(params, context), eta_(read_relative_ior(params)),
          coat_inside_(read_ior(params, "int_ior", "bk7")),
          thickness_(params.number("thickness", 0, 0)) {
        if (eta_ < 1)
            params.fail("int_ior", "the index of the coat must not be below that outside");
        if (params.has("reflectance")) {
            if (params.has("material") || params.has("eta") || params.has("k"))
                params.fail("reflectance", "give either \"reflectance\", or the metal, not both");
            reflectance_ = context.texture(params, "reflectance", Rgb(1), 1);
        }
        const TextureRef coat = context.texture(params, "coat_alpha", Rgb(0));
        if (!(coat.is_constant() && coat.eval_scalar(Vec2()) == 0))
            coat_.emplace(read_distribution(params), coat, eta_);
        is_mirror_ = !coat_ && roughness_.is_zero();
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        const auto [metal_eta, metal_k] = metal(at);
        if (is_mirror_) {
            list.add(frame, CoatedMirrorLobe{metal_eta, metal_k, eta_, thickness_}, weight);
            return;
        }
        const Microfacet facets = roughness_.eval(at);
        CoatedConductorLobe lobe{.metal = facets,
                                 .metal_eta = metal_eta,
                                 .metal_k = metal_k,
                                 .eta = eta_,
                                 .thickness = thickness_,
                                 .coat_alpha = 0,
                                 .transmittance = nullptr};
        if (coat_) {
            lobe.coat_alpha = coat_->alpha(at);
            lobe.transmittance = coat_->transmittance(lobe.coat_alpha).table();
            const float blur2 = 0.5f * sqr((1 - 1 / eta_) * lobe.coat_alpha);
            lobe.metal = {facets.kind(), std::sqrt(sqr(facets.alpha_x()) + blur2),
                          std::sqrt(sqr(facets.alpha_y()) + blur2)};
        }
        list.add(frame, lobe, weight);
    }
    bool may_be_smooth() const override { return !is_mirror_; }
    Rgb mean_albedo() const override {
        const auto [metal_eta, metal_k] = metal(TexturePoint());
        return CoatedMirrorLobe{metal_eta, metal_k, eta_, thickness_}.albedo_estimate();
    }

private:
    struct Index {
        Rgb eta, k;
    };
    /// Index of the metal over that of the coat.
    Index metal(const TexturePoint& at) const {
        Rgb eta(1), k;
        if (reflectance_) {
            const Rgb R = reflectance_->eval(at);
            for (int c = 0; c < 3; ++c) k[c] = k_of_reflectance(R[c]);
        } else {
            eta = ior_.eta.eval(at);
            k = ior_.k.eval(at);
        }
        return {eta / coat_inside_, k / coat_inside_};
    }
    /// With η = 1, a metal of normal reflectance R has k = 2 √R / √(1 − R).
    static float k_of_reflectance(float R) {
        const float r = clamp(R, 0, 0.9999f);
        return 2 * std::sqrt(r / (1 - r));
    }

    Roughness roughness_;
    ConductorIndex ior_;
    std::optional<TextureRef> reflectance_;
    float eta_;  ///< η of the coat over η outside.
    float coat_inside_, thickness_;
    std::optional<RoughCoat> coat_;
    bool is_mirror_;
};

}  // namespace

MaterialEntry coatedconductor_entry() {
    return {
        {"bsdf", "coatedconductor", "Metal below a dielectric coat.",
         concat(roughness_params(),
                {{"coat_alpha", ParamKind::Texture, "0", "Roughness of the coat; 0 is smooth."},
                 {"material", ParamKind::String, "none", "Named metal, or none for reflectance 1."},
                 {"eta", ParamKind::Texture, "0", "Real part of the metal's index."},
                 {"k", ParamKind::Texture, "1", "Imaginary part of the metal's index."},
                 {"reflectance", ParamKind::Texture, "",
                  "Reflectance of the metal at normal incidence in air, instead of material, eta "
                  "and k."},
                 {"int_ior", ParamKind::FloatOrName, "bk7",
                  "Index of refraction of the coat, at least that outside."},
                 {"ext_ior", ParamKind::FloatOrName, "air", "Index of refraction outside."},
                 {"thickness", ParamKind::Float, "0",
                  "Optical thickness of the coat: its thickness times its absorption "
                  "coefficient."}})},
        make_material<CoatedConductor>};
}

}  // namespace etendue
