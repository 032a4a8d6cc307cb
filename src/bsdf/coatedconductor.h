#pragma once

#include "bsdf/coat.h"
#include "bsdf/microfacet.h"

namespace etendue {

/// What two directions have in common in a metal of reflectance R below a coat, for their transmittances T into the
/// coat and the attenuation A of the way down and up:
///     T_o T_i A R / (1 − min(1 − T_o, 1 − T_i) A R).
/// The geometric series is exact for a smooth metal, where T_o = T_i. Elsewhere the minimum keeps it reciprocal, and the
/// energy of the metal's lobe below min(T_o, T_i).
inline Rgb coated_reflectance(Rgb metal, float To, float Ti, float attenuation) {
    // For a white metal the limit at grazing angles would be 0/0.
    if (!(To > 0 && Ti > 0)) return Rgb(0);
    const Rgb once = metal * attenuation;
    return once * (To * Ti) / (Rgb(1) - once + once * std::fmax(To, Ti));
}

/// Share of the light from outside that enters a coat; `table` is RoughTransmittance::table() of a rough one, or nullptr.
inline float coat_transmittance(const float* table, float cos, float eta) {
    return table ? RoughTransmittance::lookup(table, cos) : 1 - fresnel_dielectric(cos, eta).R;
}

/// Smooth coat over a smooth metal: a mirror with all interreflections.
struct CoatedMirrorLobe {
    Rgb metal_eta, metal_k;  ///< Index of the metal over that of the coat.
    float eta;               ///< η of the coat over η outside.
    float thickness;         ///< Optical thickness of the coat.

    BsdfEval eval(Vec3 /*wo*/, Vec3 /*wi*/) const { return {}; }
    std::optional<BsdfSample> sample(Vec3 wo, float /*u_lobe*/, Vec2 /*u*/) const {
        return delta_event(wo, false);
    }
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const {
        if (!(wo.z > 0) || transmits) return {};
        return BsdfSample{.wi = reflect(wo),
                          .weight = reflectance(wo.z),
                          .pdf = 1,
                          .pdf_rev = 1,
                          .is_delta = true};
    }
    float max_pdf(Vec3 /*wo*/, const DirectionCone& /*c*/) const { return 0; }
    Rgb albedo_estimate() const { return reflectance(1); }
    float roughness() const { return 0; }
    bool has_smooth() const { return false; }
    static constexpr bool kUsesLobeChoice = false;
    bool has_delta() const { return true; }

private:
    Rgb reflectance(float cos) const {
        const float below = cos_below_coat(cos, eta), F = fresnel_dielectric(cos, eta).R;
        const Rgb metal = fresnel_conductor(below, metal_eta, metal_k);
        return Rgb(F) +
               coated_reflectance(metal, 1 - F, 1 - F, coat_attenuation(thickness, below, below));
    }
};

/// Light that a rough metal reflects so that it cannot leave the coat, mostly beyond the critical angle. The coat reflects
/// it back to the metal, again and again, until its direction lets it out. The lobe that returns it has the form of those
/// for the multiple scattering between facets [Kulla & Conty 2017]:
///     f = C · T_o s_o · T_i s_i · A / (π m),   m = 2 ∫ T(μ) s(μ) μ dμ,
/// with the share s of the light entering from a direction that one reflection by a white metal does not send out again,
/// and the share C of trapped light that leaves later, with its colour. f is reciprocal, and ∫ f |cos θi| dωi = C T_o s_o
/// without absorption in the coat.
class TrappedLight {
public:
    /// `transmittance` is the table of a rough coat, which must outlive this object, or nullptr.
    TrappedLight(const Microfacet& metal, float eta, float thickness, const float* transmittance);

    const float* transmittance() const { return transmittance_; }
    /// s at the cosine of a direction outside.
    float share(float cos) const {
        const float x = clamp(cos, 0, 1) * (kSize - 1);
        const int i = std::min(int(x), kSize - 2);
        return lerp(x - float(i), share_[size_t(i)], share_[size_t(i) + 1]);
    }
    /// C / m for a metal of this index, relative to the coat.
    Rgb returned(Rgb metal_eta, Rgb metal_k) const;

private:
    static constexpr int kSize = 64;

    const float* transmittance_;
    std::array<float, kSize> share_;
    float mean_;  ///< m
    float
        survival_;  ///< Share of trapped light that a white metal reflects, after its way through the coat.
    float escape_;  ///< Share of this light that the coat lets out.
};

/// Smooth or rough coat over a rough metal:
///     f = f_coat + f_metal(w'o, w'i) / η² + f_trapped, with the directions w' of wo and wi refracted by the coat,
/// where coated_reflectance() takes the place of the metal's Fresnel reflectance, f_coat is a mirror reflection F(θo) or a
/// rough dielectric's reflection, and f_trapped is that of TrappedLight.
struct CoatedConductorLobe {
    Microfacet metal;        ///< With the blur by a rough coat.
    Rgb metal_eta, metal_k;  ///< Index of the metal over that of the coat.
    float eta;               ///< η of the coat over η outside, at least 1.
    float thickness;         ///< Optical thickness of the coat.
    float coat_alpha;        ///< Roughness of a rough coat.
    const TrappedLight* trapped;

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const;
    Rgb albedo_estimate() const;
    float roughness() const {
        return is_rough() ? std::fmin(coat().min_alpha(), metal.min_alpha()) : metal.min_alpha();
    }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return !is_rough(); }

private:
    /// Whether the coat is rough.
    bool is_rough() const { return trapped->transmittance() != nullptr; }
    Microfacet coat() const { return {metal.kind(), coat_alpha, coat_alpha}; }
    /// Share of the light that enters the coat.
    float T(float cos) const { return coat_transmittance(trapped->transmittance(), cos, eta); }
    /// `w` as the coat refracts it, turned back to the side of w.
    Vec3 below(Vec3 w) const { return {w.x / eta, w.y / eta, cos_below_coat(w.z, eta)}; }
};

}  // namespace etendue
