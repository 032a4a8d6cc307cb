#pragma once

#include "bsdf/lobe.h"

namespace etendue {

/// Modified Phong model [Lafortune & Willems 1994]: f = ρ_d / π + ρ_s (n + 2)/(2π) max(cos α, 0)^n,
/// with α between wi and the mirror direction of wo. It is reciprocal, and its albedo is at most
/// ρ_d + ρ_s.
struct PhongLobe {
    Rgb diffuse, specular;
    float exponent;
    float specular_probability;

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        const float lobe = std::pow(std::fmax(c.max_cos(reflect(wo)), 0.0f), exponent);
        return specular_probability * (exponent + 1) * lobe * (0.5f * kInvPi) +
               (1 - specular_probability) * std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const { return diffuse + specular; }
    /// The GGX or Beckmann α of a similar highlight.
    float roughness() const { return specular_probability > 0 ? std::sqrt(2 / (exponent + 2)) : 1; }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }
};

}  // namespace etendue
