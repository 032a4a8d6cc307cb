#pragma once

#include "bsdf/microfacet.h"
#include "math/warp.h"

namespace etendue {

/// Diffuse base under a glossy coat [Ashikhmin & Shirley 2000], with a microfacet distribution for the coat:
///     f = 28/(23π) ρ_d (1 − ρ_s) (1 − (1 − cos θi/2)⁵) (1 − (1 − cos θo/2)⁵)
///       + D(m) F(wi·m) / (4 (wi·m) max(cos θi, cos θo)),   F(c) = ρ_s + (1 − ρ_s)(1 − c)⁵.
struct FresnelBlendLobe {
    Rgb diffuse;   ///< ρ_d
    Rgb specular;  ///< ρ_s
    Microfacet distribution;

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        return kSpecularShare * distribution.max_pdf_of_reflection(wo, c) +
               (1 - kSpecularShare) * std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const { return specular + diffuse * (Rgb(1) - specular); }
    float roughness() const { return distribution.min_alpha(); }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }

private:
    static constexpr float kSpecularShare = 0.5f;  ///< Of the samples.
};

}  // namespace etendue
