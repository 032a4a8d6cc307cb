#pragma once

#include "bsdf/lobe.h"
#include "math/warp.h"

namespace etendue {

/// Reflection of V-shaped diffuse facets of which the slopes spread by σ, qualitative model [Oren & Nayar 1994]:
///     f = ρ/π (A + B max(0, cos(φi − φo)) sin α tan β)
/// with α the larger and β the smaller of θi and θo.
struct OrenNayarLobe {
    Rgb reflectance;  ///< ρ
    float A, B;

    BsdfEval eval(Vec3 wo, Vec3 wi) const {
        if (!(wo.z > 0 && wi.z > 0)) return {};
        return {reflectance * (facets(wo, wi) * wi.z * kInvPi), wi.z * kInvPi, wo.z * kInvPi};
    }
    std::optional<BsdfSample> sample(Vec3 wo, float, Vec2 u) const {
        if (!(wo.z > 0)) return {};
        const Vec3 wi = sample_cosine_hemisphere(u);
        return make_sample(wi, eval(wo, wi));
    }
    float max_pdf(Vec3, const DirectionCone& c) const {
        return std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const { return reflectance; }
    float roughness() const { return 1; }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = false;
    bool has_delta() const { return false; }

private:
    /// sin θi sin θo cos(φi − φo) is the dot product of the two in the plane, tan β has the larger cosine below it.
    float facets(Vec3 wo, Vec3 wi) const {
        const float together = std::fmax(0.0f, wo.x * wi.x + wo.y * wi.y);
        return A + B * together / std::fmax(wo.z, wi.z);
    }
};

}  // namespace etendue
