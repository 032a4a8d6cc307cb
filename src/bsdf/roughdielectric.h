#pragma once

#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"

namespace etendue {

/// Rough boundary between two dielectrics [Walter et al. 2007]: reflection as of a rough metal with
/// the dielectric's F(wo·m), and refraction at facets m ∝ ±(wo + η wi). A facet drawn among those
/// visible from wo reflects with probability F.
struct RoughDielectricLobe {
    Microfacet distribution;
    float eta;  ///< η below the surface (side of −n) over η above; not one.
    Rgb reflectance, transmittance;  ///< Factors on reflection and refraction.

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        const Vec3 own{0, 0, std::copysign(1.0f, wo.z)};
        float bound = 0;
        if (c.max_cos(own) > 0) bound = distribution.max_pdf_of_reflection(wo, c);
        if (c.max_cos(-own) > 0)
            bound = std::fmax(bound,
                              distribution.max_pdf_of_refraction(wo, c, wo.z > 0 ? eta : 1 / eta));
        return bound;
    }
    Rgb albedo_estimate() const {
        return lerp(fresnel_dielectric(1, eta).R, transmittance, reflectance);
    }
    float roughness() const { return distribution.min_alpha(); }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }
};

}  // namespace etendue
