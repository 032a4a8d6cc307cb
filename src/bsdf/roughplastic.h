#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>

#include "bsdf/microfacet.h"
#include "bsdf/plastic.h"

namespace etendue {

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
        const RoughTransmittance* made = made_.load(std::memory_order_acquire);
        return made ? *made : make();
    }

private:
    const RoughTransmittance& make() const;

    Microfacet distribution_;
    float eta_;
    mutable std::mutex making_;
    mutable std::optional<RoughTransmittance> value_;
    mutable std::atomic<const RoughTransmittance*> made_ = nullptr;  ///< `value_` once complete.
};

/// Rough dielectric coat over a diffuse base:
///     f = ρ_s F(wo·m) D(m) G(wo, wi) / (4 cos θo cos θi) + T(θo) T(θi) ρ_d / π,
/// with the rough transmittance T(θ) in place of the 1 − F(θ) of smooth plastic.
struct RoughPlasticLobe {
    Rgb diffuse;   ///< ρ_d, see PlasticParams::eval.
    Rgb specular;  ///< ρ_s
    Microfacet distribution;
    float eta;                   ///< η of the coat over η outside.
    float specular_share;        ///< As for coat_probability.
    const float* transmittance;  ///< table() of the material's RoughTransmittance.

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const {
        const float To = RoughTransmittance::lookup(transmittance, wo.z);
        const float q = coat_probability(1 - To, specular_share);
        return q * distribution.max_pdf_of_reflection(wo, c) +
               (1 - q) * std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi;
    }
    Rgb albedo_estimate() const {
        const float T = RoughTransmittance::lookup(transmittance, 1);
        return specular * (1 - T) + diffuse * sqr(T);
    }
    float roughness() const { return distribution.min_alpha(); }
    bool has_smooth() const { return true; }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return false; }
};

}  // namespace etendue
