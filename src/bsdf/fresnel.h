#pragma once
// Fresnel equations of dielectrics and conductors for unpolarised light.

#include "bsdf/lobe.h"

namespace etendue {

/// Reflection and refraction of one direction at a smooth dielectric boundary.
struct DielectricFresnel {
    /// Reflectance; 1 under total internal reflection. The transmittance is 1 − R.
    float R;
    /// Cosine of the refracted direction to the same normal, of opposite sign to cos_i; 0 if none.
    float cos_t;
    float eta;  ///< η of the refracted side over η of the incident side.
};

/// `eta` is η below the boundary (side of −n) over η above; `cos_i` > 0 comes from above, < 0 from
/// below.
inline DielectricFresnel fresnel_dielectric(float cos_i, float eta) {
    const float eta_ti = cos_i >= 0 ? eta : 1 / eta;
    const float ci = std::fabs(cos_i);
    const float cos2_t = 1 - (1 - ci) * (1 + ci) / sqr(eta_ti);
    if (!(cos2_t > 0)) return {1, 0, eta_ti};
    const float ct = std::sqrt(cos2_t);
    const float rs = (ci - eta_ti * ct) / (ci + eta_ti * ct);
    const float rp = (eta_ti * ci - ct) / (eta_ti * ci + ct);
    return {0.5f * (sqr(rs) + sqr(rp)), cos_i >= 0 ? -ct : ct, eta_ti};
}

/// 1 − R for a direction and its refraction, from the cosines of both to the normal (of any sign)
/// and η of the refracted side over η of the incident side: symmetric in the two, and accurate
/// where R is near one.
inline float fresnel_transmittance(float cos_i, float cos_t, float eta) {
    const float ci = std::fabs(cos_i), ct = std::fabs(cos_t);
    return 2 * eta * ci * ct * (1 / sqr(ci + eta * ct) + 1 / sqr(eta * ci + ct));
}

/// The direction into which `w` is refracted at a facet with normal `m` on either side; `fresnel` is
/// fresnel_dielectric(dot(w, m), η).
inline Vec3 refract(Vec3 w, Vec3 m, const DielectricFresnel& fresnel) {
    return m * (dot(w, m) / fresnel.eta + fresnel.cos_t) - w * (1 / fresnel.eta);
}
/// The same about the local normal.
inline Vec3 refract(Vec3 w, const DielectricFresnel& fresnel) {
    return {-w.x / fresnel.eta, -w.y / fresnel.eta, fresnel.cos_t};
}

/// Reflectance of a conductor with index η + ik relative to the outside, per channel; `cos_i` in
/// [0, 1].
inline Rgb fresnel_conductor(float cos_i, Rgb eta, Rgb k) {
    // a² + b² and a of the complex cosine, with t = η² − k² − sin² θ. The clamp avoids 0/0 at 90° for η = 1, k = 0.
    const float cos2 = sqr(clamp(cos_i, 1e-6f, 1));
    const float sin2 = 1 - cos2;
    const float cos1 = std::sqrt(cos2);
    Rgb result;
    for (int c = 0; c < 3; ++c) {
        const float t = sqr(eta[c]) - sqr(k[c]) - sin2;
        const float a2b2 = std::sqrt(sqr(t) + 4 * sqr(eta[c] * k[c]));
        const float a = safe_sqrt(0.5f * (a2b2 + t));
        const float s1 = a2b2 + cos2, s2 = 2 * a * cos1;
        const float p1 = cos2 * a2b2 + sqr(sin2), p2 = s2 * sin2;
        const float rs = (s1 - s2) / (s1 + s2);
        result[c] = 0.5f * rs * (1 + (p1 - p2) / (p1 + p2));
    }
    return result;
}

/// Reflectance of a smooth dielectric boundary for diffuse light from outside, 2 ∫ F(μ) μ dμ; `eta`
/// is η of the other side over η of the light's side. Closed form for eta > 1 [Walsh 1926; Duntley 1942]; eta < 1
/// follows from 1 − F_int = (1 − F_ext)/η².
float fresnel_diffuse_reflectance(float eta);
/// 1 − fresnel_diffuse_reflectance(eta), also where this is far below the resolution of the reflectance.
float fresnel_diffuse_transmittance(float eta);

}  // namespace etendue
