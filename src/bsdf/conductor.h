#pragma once

#include "bsdf/fresnel.h"

namespace etendue {

/// Ideal mirror of a metal with index η + ik: f = ρ F(θ) δ.
struct ConductorLobe {
    Rgb eta, k;
    Rgb reflectance;  ///< ρ

    BsdfEval eval(Vec3 /*wo*/, Vec3 /*wi*/) const { return {}; }
    std::optional<BsdfSample> sample(Vec3 wo, float /*u_lobe*/, Vec2 /*u*/) const {
        return delta_event(wo, false);
    }
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const {
        if (!(wo.z > 0) || transmits) return {};
        return BsdfSample{.wi = reflect(wo),
                          .weight = reflectance * fresnel_conductor(wo.z, eta, k),
                          .pdf = 1,
                          .pdf_rev = 1,
                          .is_delta = true};
    }
    float max_pdf(Vec3 /*wo*/, const DirectionCone& /*c*/) const { return 0; }
    Rgb albedo_estimate() const { return reflectance * fresnel_conductor(1, eta, k); }
    float roughness() const { return 0; }
    bool has_smooth() const { return false; }
    static constexpr bool kUsesLobeChoice = false;
    bool has_delta() const { return true; }
};

}  // namespace etendue
