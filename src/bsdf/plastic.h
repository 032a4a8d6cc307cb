#pragma once

#include "bsdf/coat.h"
#include "math/warp.h"

namespace etendue {

/// Smooth dielectric coat over a diffuse base: a mirror reflection ρ_s F(θo) and
///     f = (1 − F(θo)) (1 − F(θi)) exp(−τ (1/cos θ'o + 1/cos θ'i)) ρ_d / π,
/// with the optical thickness τ of the coat and the angles θ' in it.
struct PlasticLobe {
    Rgb diffuse;           ///< ρ_d, see PlasticParams::eval.
    Rgb specular;          ///< ρ_s
    float eta;             ///< η of the coat over η outside.
    float specular_share;  ///< As for coat_probability.
    float thickness;       ///< Optical thickness of the coat.

    BsdfEval eval(Vec3 wo, Vec3 wi) const {
        if (!(wo.z > 0 && wi.z > 0)) return {};
        const float Fo = fresnel_dielectric(wo.z, eta).R, Fi = fresnel_dielectric(wi.z, eta).R;
        const float attenuation =
            coat_attenuation(thickness, cos_below_coat(wo.z, eta), cos_below_coat(wi.z, eta));
        return {.f = diffuse * ((1 - Fo) * (1 - Fi) * attenuation * wi.z * kInvPi),
                .pdf = (1 - coat_probability(Fo, specular_share)) * wi.z * kInvPi,
                .pdf_rev = (1 - coat_probability(Fi, specular_share)) * wo.z * kInvPi};
    }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const {
        if (!(wo.z > 0)) return {};
        const float F = fresnel_dielectric(wo.z, eta).R, q = coat_probability(F, specular_share);
        if (u_lobe < q) return reflected(wo, F, q);
        const Vec3 wi = sample_cosine_hemisphere(u);
        return make_sample(wi, eval(wo, wi));
    }
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const {
        if (!(wo.z > 0) || transmits) return {};
        const float F = fresnel_dielectric(wo.z, eta).R, q = coat_probability(F, specular_share);
        if (!(q > 0)) return {};
        return reflected(wo, F, q);
    }
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        const float F = fresnel_dielectric(wo.z, eta).R, q = coat_probability(F, specular_share);
        return (1 - q) * std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const {
        const float F = fresnel_dielectric(1, eta).R;
        return specular * F + diffuse * sqr(1 - F);
    }
    float roughness() const { return 1; }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return true; }

private:
    BsdfSample reflected(Vec3 wo, float F, float q) const {
        return {.wi = reflect(wo),
                .weight = specular * (F / q),
                .pdf = q,
                .pdf_rev = q,
                .is_delta = true};
    }
};

}  // namespace etendue
