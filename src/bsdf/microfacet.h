#pragma once
// Distributions of microfacet normals, GGX and Beckmann, with anisotropic roughness and Smith
// shadowing.
//
// All formulas use the projected area of the microsurface seen from w,
//     σ(w) = ∫ max(w·m, 0) D(m) dm = |cos θ| (1 + Λ(w)) = |cos θ| / G1(w),
// which stays finite and above zero at grazing angles. With it
//     D_w(m)    = max(w·m, 0) D(m) / σ(w)               density of visible normals [Heitz 2014],
//     G(wo, wi) = |cos θ_o| |cos θ_i| / (σ(wo) σ(wi))   separable Smith shadowing.

#include "bsdf/lobe.h"

namespace etendue {

/// Bounds on the half vectors m of one direction wo and all directions wi of a cone.
struct HalfwayBound {
    float theta = 0;   ///< Lower bound of the angle between m and ±z, in radians.
    float cos_d = 0;   ///< Lower bound of the cosine between m and wo or wi; for reflection only.
    float length = 0;  ///< Lower bound of |wo + η wi|; for refraction only.
};
/// m ∝ ±(wo + wi). As wi turns by dα, m turns by at most dα / (2 cos θ_d), θ_d = ∠(wo, m) = ∠(wo, wi)/2.
HalfwayBound halfway_of_reflection(Vec3 wo, const DirectionCone& c);
/// m ∝ ±(wo + η wi).
HalfwayBound halfway_of_refraction(Vec3 wo, const DirectionCone& c, float eta);

class Microfacet {
public:
    enum class Kind : uint8_t { Beckmann, Ggx };

    /// Roughness is clamped to this range; float directions do not resolve sharper highlights.
    static constexpr float kMinAlpha = 1e-4f, kMaxAlpha = 100;

    Microfacet() = default;
    Microfacet(Kind kind, float alpha_x, float alpha_y)
        : alpha_x_(clamp(alpha_x, kMinAlpha, kMaxAlpha)),
          alpha_y_(clamp(alpha_y, kMinAlpha, kMaxAlpha)), kind_(kind) {}

    /// Density of normals about z: ∫ D(m) cos θ_m dm = 1 over the upper hemisphere, 0 below it.
    float D(Vec3 m) const {
        if (!(m.z > 0)) return 0;
        const float e = sqr(m.x / alpha_x_) + sqr(m.y / alpha_y_), cos2 = sqr(m.z);
        const float norm = kPi * alpha_x_ * alpha_y_;
        if (kind_ == Kind::Ggx) return 1 / (norm * sqr(e + cos2));
        const float density = std::exp(-e / cos2);
        return density > 0 ? density / (norm * sqr(cos2)) : 0;
    }

    /// Upper bound of D over all normals at an angle of at least `theta` to z.
    float max_D(float theta) const;
    /// Upper bound of the density D_wo(m) dω_m/dω_i = D / (4 σ(wo)) over a cone of reflected directions.
    float max_pdf_of_reflection(Vec3 wo, const DirectionCone& c) const {
        return 0.25f * max_D(halfway_of_reflection(wo, c).theta) / sigma(wo);
    }
    /// The same for refracted directions, with density D |wo·m| |wi·m| η² / (|wo + η wi|² σ(wo)); `eta` is η on their
    /// side over η on wo's side.
    float max_pdf_of_refraction(Vec3 wo, const DirectionCone& c, float eta) const;

    /// Projected area σ(w) for `w` on either side.
    float sigma(Vec3 w) const {
        const float cos = std::fabs(w.z), s2 = sqr(alpha_x_ * w.x) + sqr(alpha_y_ * w.y);
        if (kind_ == Kind::Ggx) return 0.5f * (cos + std::sqrt(sqr(cos) + s2));
        const float s = std::sqrt(s2);
        if (cos > 4 * s) return cos;  // 1 − erf(4) < 2e-8
        const float a = cos / s;
        return 0.5f * (cos * (1 + std::erf(a)) + s * std::exp(-sqr(a)) * kInvSqrtPi);
    }
    /// Smith masking G1(w) = |cos θ| / σ(w).
    float G1(Vec3 w) const { return std::fabs(w.z) / sigma(w); }

    /// Solid-angle density of sample_visible(w): D_w(m), with w.z > 0.
    float pdf_visible(Vec3 w, Vec3 m) const { return std::max(0.0f, dot(w, m)) * D(m) / sigma(w); }
    /// A normal with density D_w(m), for w.z > 0: GGX by spherical caps [Dupuy & Benyoub 2023],
    /// Beckmann by inverting the slope distribution [Heitz & d'Eon 2014].
    Vec3 sample_visible(Vec3 w, Vec2 u) const;

    float alpha_x() const { return alpha_x_; }
    float alpha_y() const { return alpha_y_; }
    float min_alpha() const { return std::min(alpha_x_, alpha_y_); }
    Kind kind() const { return kind_; }

private:
    static constexpr float kInvSqrtPi = 0.56418958354775628695f;

    float alpha_x_ = 0.1f, alpha_y_ = 0.1f;
    Kind kind_ = Kind::Beckmann;
};

}  // namespace etendue
