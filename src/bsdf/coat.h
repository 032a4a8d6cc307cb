#pragma once
// Dielectric coats over opaque bases. A coat absorbs but does not scatter.

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"
#include "texture/texture.h"

namespace etendue {

/// Probability of sampling the specular part, where the specular part receives `F` and the diffuse part 1 − `F` of the
/// light, and `specular_share` is the share of the specular colour in the sum of both colours.
inline float coat_probability(float F, float specular_share) {
    const float s = F * specular_share, d = (1 - F) * (1 - specular_share);
    return s + d > 0 ? s / (s + d) : 0;
}

/// Cosine below the coat of a direction with cosine `cos` >= 0 above it; 0 under total reflection.
inline float cos_below_coat(float cos, float eta) {
    if (eta == 1) return cos;  // its square may be zero
    return safe_sqrt((sqr(cos) + (eta - 1) * (eta + 1)) / sqr(eta));
}
/// What a coat of optical thickness τ lets pass on the way down and up again, exp(−τ (1/c_o + 1/c_i)), for the cosines
/// of both directions below it.
inline float coat_attenuation(float thickness, float cos_o, float cos_i) {
    return thickness > 0 ? std::exp(-thickness * (1 / cos_o + 1 / cos_i)) : 1.0f;
}
/// Share of diffuse light from the base that a smooth coat reflects back to it, with the absorption on this way:
///     2 ∫ F(μ) exp(−2τ/μ) μ dμ;
/// `eta` is η of the coat over η outside.
float reflectance_below_coat(float eta, float thickness);
/// 1 − reflectance_below_coat(): above zero also where η is large.
float loss_below_coat(float eta, float thickness);

/// Mean of `value(m)` over the facets m visible from `wo`, by the midpoint rule with n × n points.
template <class F>
double mean_over_visible_normals(int n, const Microfacet& distribution, Vec3 wo, const F& value) {
    double sum = 0;
    for (int i = 0; i < n * n; ++i)
        sum += value(distribution.sample_visible(
            wo, {(float(i % n) + 0.5f) / float(n), (float(i / n) + 0.5f) / float(n)}));
    return sum / (n * n);
}

/// A value that the first thread to need it makes.
template <class T>
class MadeOnce {
public:
    template <class Make>
    const T& get(const Make& make) const {
        if (const T* made = made_.load(std::memory_order_acquire)) return *made;
        const std::lock_guard lock(making_);
        if (!value_) value_.emplace(make());
        made_.store(&*value_, std::memory_order_release);
        return *value_;
    }

private:
    mutable std::mutex making_;
    mutable std::optional<T> value_;
    mutable std::atomic<const T*> made_ = nullptr;  ///< `value_` once complete.
};

/// Rough transmittance T(θ) of a dielectric boundary: the share of light from outside that is refracted at the first
/// facet and not masked afterwards.
class RoughTransmittance {
public:
    /// `eta` is η of the inside over η outside.
    RoughTransmittance(const Microfacet& distribution, float eta);

    /// T at `cos_theta` >= 0 from `table()`.
    static float lookup(const float* table, float cos_theta) {
        const float x = std::max(cos_theta, 0.0f) * (kSize - 1);
        const int i = std::min(int(x), kSize - 2);
        return lerp(x - float(i), table[i], table[i + 1]);
    }
    const float* table() const { return external_.data(); }
    /// Share of diffuse light from inside that is reflected at the first facet.
    float internal_reflectance() const { return internal_reflectance_; }

private:
    static constexpr int kSize = 64;

    std::array<float, kSize> external_;
    float internal_reflectance_;
};

/// A transmittance that is computed when it is first needed. All materials with the same coat share it.
class SharedTransmittance {
public:
    /// That of a coat of one distribution, isotropic roughness and relative index.
    static std::shared_ptr<SharedTransmittance> of(Microfacet::Kind kind, float alpha, float eta);

    SharedTransmittance(const Microfacet& distribution, float eta)
        : distribution_(distribution), eta_(eta) {}
    const RoughTransmittance& get() const {
        return value_.get([this] { return RoughTransmittance(distribution_, eta_); });
    }

private:
    Microfacet distribution_;
    float eta_;
    MadeOnce<RoughTransmittance> value_;
};

/// Number of roughnesses for which tables are made where α is textured; they are equidistant in √α.
constexpr int kAlphaRows = 33;
inline float alpha_of_row(size_t row) {
    return sqr(float(row) / (kAlphaRows - 1));
}
/// The row nearest to α.
inline size_t alpha_row(float alpha) {
    const float row = std::sqrt(clamp(alpha, 0, 1)) * (kAlphaRows - 1) + 0.5f;
    return std::min(size_t(row), size_t(kAlphaRows - 1));
}

/// A coat with an isotropic roughness, constant or textured.
class RoughCoat {
public:
    RoughCoat(Microfacet::Kind kind, TextureRef alpha, float eta);

    float alpha(const TexturePoint& at) const { return alpha_.eval_scalar(at); }
    Microfacet distribution(float alpha) const { return {kind_, alpha, alpha}; }
    /// The transmittance for `alpha`; where it is textured, for the nearest of kAlphaRows roughnesses, the same for both
    /// ends of a path.
    const RoughTransmittance& transmittance(float alpha) const {
        return transmittance_[row(alpha)]->get();
    }
    size_t rows() const { return transmittance_.size(); }
    size_t row(float alpha) const { return rows() == 1 ? 0 : alpha_row(alpha); }

private:
    Microfacet::Kind kind_;
    TextureRef alpha_;
    std::vector<std::shared_ptr<const SharedTransmittance>> transmittance_;
};

}  // namespace etendue
