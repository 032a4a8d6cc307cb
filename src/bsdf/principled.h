#pragma once

#include "bsdf/microfacet.h"

namespace etendue {

/// Disney's principled BSDF [Burley 2012, 2015] in the form of Mitsuba 3; see principled.cpp. All parameters except
/// `eta` lie in [0, 1].
struct PrincipledLobe {
    Rgb base_color;
    float surface_roughness;  ///< Square root of the main specular lobe's α.
    float anisotropic;
    float metallic;
    float spec_trans;  ///< Share of refraction in what is not metallic; the rest is diffuse.
    float eta;         ///< η below the surface over η above.
    float spec_tint;
    float sheen, sheen_tint;
    float flatness;  ///< Share of the fake subsurface scattering in the diffuse part.
    float clearcoat, clearcoat_gloss;

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const;
    Rgb albedo_estimate() const { return base_color; }
    float roughness() const;
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }

private:
    float diffuse_weight() const { return (1 - metallic) * (1 - spec_trans); }
    float refraction_weight() const { return (1 - metallic) * spec_trans; }
    /// Normals of the main specular lobe, for reflection and refraction.
    Microfacet main_distribution() const;
    /// Probabilities of sampling the parts, for wo above the surface; below it only the main part is sampled.
    struct Selection {
        float diffuse, clearcoat, main;
    };
    Selection selection() const;
    /// Probability that sampling reflects at a visible normal of the main part with Fresnel reflectance F; otherwise it
    /// refracts.
    float reflection_probability(bool is_above, float F) const;

    BsdfEval eval_reflection(Vec3 wo, Vec3 wi) const;
    BsdfEval eval_refraction(Vec3 wo, Vec3 wi) const;
    bool has_main() const { return eta != 1 || metallic > 0 || spec_trans > 0 || spec_tint > 0; }
    Rgb specular_color(bool is_above, float cos_m, float F) const;
    Rgb diffuse_and_sheen(Vec3 wo, Vec3 wi, float cos_m) const;
    Rgb tint() const;
};

}  // namespace etendue
