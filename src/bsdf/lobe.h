#pragma once
// A lobe is one closed-form scattering model with its parameters looked up. It works in local coordinates (z = shading
// normal) and knows nothing of the direction of transport; `Bsdf` (bsdf.h) adds that.

#include <cmath>
#include <cstdint>
#include <optional>

#include "color/rgb.h"
#include "math/frame.h"

namespace etendue {

/// Quantity transported by a walk: radiance for walks from the eye (`wo` points toward the eye), importance for walks
/// from a light.
enum class TransportMode : uint8_t { Radiance, Importance };

/// Value of the smooth part of a lobe for a pair of directions. Delta components contribute nothing here.
struct BsdfEval {
    Rgb f;  ///< f(wo, wi)·|cos θ_i|, for importance transport (without the η² of radiance).
    /// Solid-angle density of sampling wi from wo, including the choice of the lobe, not renormalised.
    float pdf = 0;
    float pdf_rev = 0;  ///< The same for sampling wo from wi.
    float eta = 1;      ///< η on wi's side over η on wo's side; 1 for reflection.
};

struct BsdfSample {
    Vec3 wi;
    Rgb weight;     ///< BsdfEval::f / pdf; for a delta event its coefficient divided by `pdf`.
    float pdf = 0;  ///< As BsdfEval; for a delta event its discrete probability.
    /// As BsdfEval; for a delta event the discrete probability of the reverse event. Bsdf multiplies the latter by
    /// |dω_i/dω_o|, so that the densities of both directions of a path refer to the same δ.
    float pdf_rev = 0;
    float eta = 1;  ///< As BsdfEval.
    bool is_delta = false;
    uint8_t event = 0;  ///< Number of a delta event, see Bsdf::sample_delta().
    float gain = 1;     ///< `pdf` over that without guide, see Vertex::sample().
};

/// All directions within `angle` (radians, at most π) of `axis`.
struct DirectionCone {
    Vec3 axis;
    float angle;

    /// Upper bound of dot(w, n) over the cone. The slack covers the rounding errors of acos near 0 and π.
    float max_cos(Vec3 n) const {
        constexpr float kSlack = 1e-3f;
        const float a = std::acos(clamp(dot(axis, n), -1.0f, 1.0f)) - angle - kSlack;
        return a > 0 ? std::cos(a) : 1.0f;
    }
    /// Upper bound of the density cos θ/π about `n` over the cone.
    float max_cosine_pdf(Vec3 n) const {
        const float cos = dot(axis, n), cos_cone = std::cos(angle);
        if (cos > cos_cone) return kInvPi;
        // cos(acos(cos) - angle), at least 0.
        return kInvPi *
               std::fmax(0.0f, cos * cos_cone + safe_sqrt(1 - cos * cos) * std::sin(angle));
    }
};

/// The sample of a smooth lobe from its value and densities; empty where the density is zero.
inline std::optional<BsdfSample> make_sample(Vec3 wi, const BsdfEval& e) {
    if (!(e.pdf > 0)) return {};
    return BsdfSample{
        .wi = wi, .weight = e.f / e.pdf, .pdf = e.pdf, .pdf_rev = e.pdf_rev, .eta = e.eta};
}

// ---- Lobes: each has
//   BsdfEval eval(Vec3 wo, Vec3 wi) const
//   std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const      empty where the walk ends
//   Rgb albedo_estimate() const       rough hemispherical reflectance, for AOVs and heuristics
//   float roughness() const           GGX-like α of the *sharpest smooth* lobe: 0 delta only … 1 diffuse
//   bool has_smooth() const, has_delta() const
//   std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const       only where there are delta events
//   bool kUsesLobeChoice              whether sample() reads u_lobe
//   float max_pdf(Vec3 wo, const DirectionCone& c) const   upper bound of eval(wo, wi).pdf for wi in c; kInf if unknown
// `wo` and `wi` are unit vectors in local coordinates, away from the surface. A lobe that only reflects is black for
// wo.z <= 0 (the material `twosided` turns the frame). A lobe may have both a smooth part and a delta part.

}  // namespace etendue
