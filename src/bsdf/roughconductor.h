#pragma once

#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"

namespace etendue {

/// Rough metal: f |cos θ_i| = ρ F(wo·m) D(m) G(wo, wi) / (4 |cos θ_o|), m the half vector [Walter
/// et al. 2007, eq. 20].
struct RoughConductorLobe {
    Microfacet distribution;
    Rgb eta, k;
    Rgb reflectance;  ///< ρ

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        return distribution.max_pdf_of_reflection(wo, c);
    }
    Rgb albedo_estimate() const { return reflectance * fresnel_conductor(1, eta, k); }
    float roughness() const { return distribution.min_alpha(); }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = false;
    bool has_delta() const { return false; }
};

}  // namespace etendue
