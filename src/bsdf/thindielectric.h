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
        const float R = pane_reflectance(std::fabs(wo.z));
        if (u_lobe < R)
            return BsdfSample{
                .wi = reflect(wo), .weight = reflectance, .pdf = R, .pdf_rev = R, .is_delta = true};
        return BsdfSample{
            .wi = -wo, .weight = transmittance, .pdf = 1 - R, .pdf_rev = 1 - R, .is_delta = true};
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
