#pragma once

#include "bsdf/lobe.h"
#include "math/warp.h"

namespace etendue {

/// Diffuse reflection ρ/π and diffuse transmission τ/π, from either side.
struct DiffuseTransmissionLobe {
    Rgb reflectance, transmittance;  ///< ρ, τ

    BsdfEval eval(Vec3 wo, Vec3 wi) const {
        const float cos_o = std::fabs(wo.z), cos_i = std::fabs(wi.z);
        if (!(cos_o > 0 && cos_i > 0)) return {};
        const bool reflects = wo.z * wi.z > 0;
        const float q = reflects ? reflected_share() : 1 - reflected_share();
        return {(reflects ? reflectance : transmittance) * (cos_i * kInvPi), q * cos_i * kInvPi,
                q * cos_o * kInvPi};
    }
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const {
        if (wo.z == 0) return {};
        Vec3 wi = sample_cosine_hemisphere(u);
        if ((u_lobe < reflected_share()) != (wo.z > 0)) wi.z = -wi.z;
        return make_sample(wi, eval(wo, wi));
    }
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        const Vec3 own{0, 0, std::copysign(1.0f, wo.z)};
        return std::fmax(reflected_share() * std::fmax(c.max_cos(own), 0.0f),
                         (1 - reflected_share()) * std::fmax(c.max_cos(-own), 0.0f)) *
               kInvPi;
    }
    Rgb albedo_estimate() const { return reflectance + transmittance; }
    float roughness() const { return 1; }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }

private:
    float reflected_share() const {
        const float sum = reflectance.mean() + transmittance.mean();
        return sum > 0 ? reflectance.mean() / sum : 0.5f;
    }
};

}  // namespace etendue
