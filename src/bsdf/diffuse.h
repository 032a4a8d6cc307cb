#pragma once

#include "bsdf/lobe.h"
#include "math/warp.h"

namespace etendue {

/// Ideal diffuse reflection: f = ρ/π, sampled with density cos θ / π.
struct DiffuseLobe {
    Rgb reflectance;

    BsdfEval eval(Vec3 wo, Vec3 wi) const {
        if (!(wo.z > 0 && wi.z > 0)) return {};
        return {reflectance * (wi.z * kInvPi), wi.z * kInvPi, wo.z * kInvPi};
    }
    std::optional<BsdfSample> sample(Vec3 wo, float /*u_lobe*/, Vec2 u) const {
        if (!(wo.z > 0)) return {};
        const Vec3 wi = sample_cosine_hemisphere(u);
        if (!(wi.z > 0)) return {};
        return BsdfSample{
            .wi = wi, .weight = reflectance, .pdf = wi.z * kInvPi, .pdf_rev = wo.z * kInvPi};
    }
    float max_pdf(Vec3 /*wo*/, const DirectionCone& c) const {
        return std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const { return reflectance; }
    float roughness() const { return 1; }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = false;
    bool has_delta() const { return false; }
};

}  // namespace etendue
