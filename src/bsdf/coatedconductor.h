#pragma once

#include "bsdf/coat.h"
#include "bsdf/microfacet.h"

namespace etendue {

/// What two directions have in common in a metal of reflectance R below a coat, for their transmittances T into the
/// coat and the attenuation A of the way down and up:
///     T_o T_i A R / (1 − min(1 − T_o, 1 − T_i) A R).
/// The geometric series is exact for a smooth metal, where T_o = T_i. Elsewhere the minimum keeps it reciprocal, and the
/// energy of the metal's lobe below min(T_o, T_i).
inline Rgb coated_reflectance(Rgb metal, float To, float Ti, float attenuation) {
    const Rgb once = metal * attenuation;
    return once * (To * Ti) / (Rgb(1) - once * std::fmin(1 - To, 1 - Ti));
}

/// Smooth coat over a smooth metal: a mirror with all interreflections.
struct CoatedMirrorLobe {
    Rgb metal_eta, metal_k;  ///< Index of the metal over that of the coat.
    float eta;               ///< η of the coat over η outside.
    float thickness;         ///< Optical thickness of the coat.

    BsdfEval eval(Vec3 /*wo*/, Vec3 /*wi*/) const { return {}; }
    std::optional<BsdfSample> sample(Vec3 wo, float /*u_lobe*/, Vec2 /*u*/) const {
        return delta_event(wo, false);
    }
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const {
        if (!(wo.z > 0) || transmits) return {};
        return BsdfSample{.wi = reflect(wo),
                          .weight = reflectance(wo.z),
                          .pdf = 1,
                          .pdf_rev = 1,
                          .is_delta = true};
    }
    float max_pdf(Vec3 /*wo*/, const DirectionCone& /*c*/) const { return 0; }
    Rgb albedo_estimate() const { return reflectance(1); }
    float roughness() const { return 0; }
    bool has_smooth() const { return false; }
    static constexpr bool kUsesLobeChoice = false;
    bool has_delta() const { return true; }

private:
    Rgb reflectance(float cos) const {
        const float below = cos_below_coat(cos, eta), F = fresnel_dielectric(cos, eta).R;
        const Rgb metal = fresnel_conductor(below, metal_eta, metal_k);
        return Rgb(F) +
               coated_reflectance(metal, 1 - F, 1 - F, coat_attenuation(thickness, below, below));
    }
};

/// Smooth or rough coat over a rough metal:
///     f = f_coat + f_metal(w'o, w'i) / η², with the directions w' of wo and wi refracted by the coat,
/// where coated_reflectance() takes the place of the metal's Fresnel reflectance, and f_coat is a mirror reflection
/// F(θo) or a rough dielectric's reflection.
struct CoatedConductorLobe {
    Microfacet metal;        ///< With the blur by a rough coat.
    Rgb metal_eta, metal_k;  ///< Index of the metal over that of the coat.
    float eta;               ///< η of the coat over η outside, at least 1.
    float thickness;         ///< Optical thickness of the coat.
    float coat_alpha;        ///< Roughness of a rough coat.
    /// table() of a rough coat's RoughTransmittance; nullptr where the coat is smooth.
    const float* transmittance;

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const;
    Rgb albedo_estimate() const;
    float roughness() const {
        return transmittance ? std::fmin(coat().min_alpha(), metal.min_alpha()) : metal.min_alpha();
    }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return !transmittance; }

private:
    Microfacet coat() const { return {metal.kind(), coat_alpha, coat_alpha}; }
    /// Share of the light that enters the coat.
    float T(float cos) const {
        return transmittance ? RoughTransmittance::lookup(transmittance, cos)
                             : 1 - fresnel_dielectric(cos, eta).R;
    }
    /// `w` as the coat refracts it, turned back to the side of w.
    Vec3 below(Vec3 w) const { return {w.x / eta, w.y / eta, cos_below_coat(w.z, eta)}; }
};

}  // namespace etendue
