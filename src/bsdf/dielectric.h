#pragma once

#include "bsdf/fresnel.h"

namespace etendue {

/// Smooth boundary between two dielectrics: reflection with probability F, refraction with 1 − F.
struct DielectricLobe {
    float eta;                       ///< η below the surface (side of −n) over η above.
    Rgb reflectance, transmittance;  ///< Factors on F and 1 − F.

    BsdfEval eval(Vec3 /*wo*/, Vec3 /*wi*/) const { return {}; }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 /*u*/) const {
        if (wo.z == 0) return {};
        const DielectricFresnel fresnel = fresnel_dielectric(wo.z, eta);
        return delta_event(wo, fresnel, !(u_lobe < fresnel.R));
    }
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const {
        if (wo.z == 0) return {};
        const DielectricFresnel fresnel = fresnel_dielectric(wo.z, eta);
        if (!((transmits ? 1 - fresnel.R : fresnel.R) > 0)) return {};
        return delta_event(wo, fresnel, transmits);
    }
    float max_pdf(Vec3 /*wo*/, const DirectionCone& /*c*/) const { return 0; }
    Rgb albedo_estimate() const {
        return lerp(fresnel_dielectric(1, eta).R, transmittance, reflectance);
    }
    float roughness() const { return 0; }
    bool has_smooth() const { return false; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return true; }

private:
    /// F is the same from both ends of a refracted path, and so is the choice by it.
    BsdfSample delta_event(Vec3 wo, const DielectricFresnel& fresnel, bool transmits) const {
        if (!transmits)
            return {.wi = reflect(wo),
                    .weight = reflectance,
                    .pdf = fresnel.R,
                    .pdf_rev = fresnel.R,
                    .is_delta = true};
        const float T = 1 - fresnel.R;
        return {.wi = normalize(refract(wo, fresnel)),
                .weight = transmittance,
                .pdf = T,
                .pdf_rev = T,
                .eta = fresnel.eta,
                .is_delta = true};
    }
};

}  // namespace etendue
