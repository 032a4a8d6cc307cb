#pragma once

#include "bsdf/fresnel.h"

namespace etendue {

/// A pane too thin to displace light: mirror reflection, and transmission straight ahead, each with
/// all internal reflections R' = R + T² R (1 + R² + …) = 2R / (1 + R).
struct ThinDielectricLobe {
    float eta;                       ///< η of the pane over η around it.
    Rgb reflectance, transmittance;  ///< Factors on R' and 1 − R'.

    BsdfEval eval(Vec3 /*wo*/, Vec3 /*wi*/) const { return {}; }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 /*u*/) const {
        if (wo.z == 0) return {};
        return delta_event(wo, !(u_lobe < pane_reflectance(std::fabs(wo.z))));
    }
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const {
        const float R = pane_reflectance(std::fabs(wo.z)), p = transmits ? 1 - R : R;
        if (wo.z == 0 || !(p > 0)) return {};
        return BsdfSample{.wi = transmits ? -wo : reflect(wo),
                          .weight = transmits ? transmittance : reflectance,
                          .pdf = p,
                          .pdf_rev = p,
                          .is_delta = true};
    }
    float max_pdf(Vec3 /*wo*/, const DirectionCone& /*c*/) const { return 0; }
    Rgb albedo_estimate() const { return lerp(pane_reflectance(1), transmittance, reflectance); }
    float roughness() const { return 0; }
    bool has_smooth() const { return false; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return true; }

private:
    float pane_reflectance(float cos) const {
        const float R = fresnel_dielectric(cos, eta).R;
        return 2 * R / (1 + R);
    }
};

}  // namespace etendue
