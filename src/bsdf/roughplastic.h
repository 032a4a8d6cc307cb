#pragma once

#include "bsdf/coat.h"
#include "bsdf/microfacet.h"
#include "math/warp.h"

namespace etendue {

/// Rough dielectric coat over a diffuse base:
///     f = ρ_s F(wo·m) D(m) G(wo, wi) / (4 cos θo cos θi) + T(θo) T(θi) ρ_d / π,
/// with the rough transmittance T(θ) in place of the 1 − F(θ) of smooth plastic, and the same attenuation.
struct RoughPlasticLobe {
    Rgb diffuse;   ///< ρ_d, see PlasticParams::eval.
    Rgb specular;  ///< ρ_s
    Microfacet distribution;
    float eta;                   ///< η of the coat over η outside.
    float specular_share;        ///< As for coat_probability.
    float thickness;             ///< Optical thickness of the coat.
    const float* transmittance;  ///< table() of the material's RoughTransmittance.

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        const float To = RoughTransmittance::lookup(transmittance, wo.z);
        const float q = coat_probability(1 - To, specular_share);
        return q * distribution.max_pdf_of_reflection(wo, c) +
               (1 - q) * std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const {
        const float T = RoughTransmittance::lookup(transmittance, 1);
        return specular * (1 - T) + diffuse * sqr(T);
    }
    float roughness() const { return distribution.min_alpha(); }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }
};

}  // namespace etendue
