#include "bsdf/coat.h"

#include <map>
#include <tuple>

namespace etendue {
namespace {

/// Share of the light from `wo` that a rough dielectric refracts at the first facet: the mean of (1 − F(wo·m)) G1(wi).
double rough_transmittance(const Microfacet& distribution, float eta, Vec3 wo) {
    return mean_over_visible_normals(32, distribution, wo, [&](Vec3 m) {
        const DielectricFresnel fresnel = fresnel_dielectric(dot(wo, m), eta);
        const Vec3 wi = refract(wo, m, fresnel);
        return wi.z < 0 ? (1 - fresnel.R) * distribution.G1(wi) : 0;
    });
}

/// Share that it reflects at the first facet: the mean of F(wo·m) G1(wi). Total internal reflection needs more points.
double rough_reflectance(const Microfacet& distribution, float eta, Vec3 wo) {
    return mean_over_visible_normals(64, distribution, wo, [&](Vec3 m) {
        const Vec3 wi = reflect(wo, m);
        return wi.z > 0 ? fresnel_dielectric(dot(wo, m), eta).R * distribution.G1(wi) : 0;
    });
}

}  // namespace

RoughTransmittance::RoughTransmittance(const Microfacet& distribution, float eta) {
    constexpr float kGrazing = 1e-6f;
    double internal = 0;
    for (int i = 0; i < kSize; ++i) {
        const float cos_theta = std::max(float(i) / (kSize - 1), kGrazing);
        const Vec3 wo{std::sqrt((1 - cos_theta) * (1 + cos_theta)), 0, cos_theta};
        external_[i] = float(rough_transmittance(distribution, eta, wo));
        internal += 2 * cos_theta * rough_reflectance(distribution, 1 / eta, wo);
    }
    // 2 ∫ R(μ) μ dμ with equal weights of all nodes, as in Mitsuba 3, to match its images; the trapezoidal rule gives
    // about 1 % more.
    internal_reflectance_ = float(internal / kSize);
}

std::shared_ptr<SharedTransmittance> SharedTransmittance::of(Microfacet::Kind kind, float alpha,
                                                             float eta) {
    static std::mutex mutex;
    static std::map<std::tuple<Microfacet::Kind, float, float>, std::weak_ptr<SharedTransmittance>>
        all;
    const std::lock_guard lock(mutex);
    std::weak_ptr<SharedTransmittance>& known = all[{kind, alpha, eta}];
    std::shared_ptr<SharedTransmittance> shared = known.lock();
    if (!shared)
        known = shared = std::make_shared<SharedTransmittance>(Microfacet{kind, alpha, alpha}, eta);
    return shared;
}

RoughCoat::RoughCoat(Microfacet::Kind kind, TextureRef alpha, float eta)
    : kind_(kind), alpha_(alpha) {
    const auto add = [&](float value) {
        transmittance_.push_back(SharedTransmittance::of(kind, value, eta));
    };
    if (alpha.is_constant())
        add(alpha.eval_scalar(Vec2()));
    else
        for (size_t i = 0; i < kAlphaRows; ++i) add(alpha_of_row(i));
}

float reflectance_below_coat(float eta, float thickness) {
    if (thickness == 0) return fresnel_diffuse_reflectance(1 / eta);
    // The midpoint rule, on either side of the critical angle, where F has an edge.
    constexpr int kPoints = 2000;
    const double critical = eta > 1 ? std::sqrt(1 - 1 / sqr(double(eta))) : 0.0;
    double sum = 0;
    for (const auto& [from, to] : {std::pair(0.0, critical), {critical, 1.0}})
        for (int i = 0; i < kPoints; ++i) {
            const double mu = from + (to - from) * (i + 0.5) / kPoints;
            sum += 2 * mu * (to - from) / kPoints * std::exp(-2 * double(thickness) / mu) *
                   double(fresnel_dielectric(float(mu), 1 / eta).R);
        }
    return float(sum);
}

float loss_below_coat(float eta, float thickness) {
    const float transmitted = fresnel_diffuse_transmittance(1 / eta);
    if (thickness == 0) return transmitted;
    return std::max(1 - reflectance_below_coat(eta, thickness), transmitted);
}

}  // namespace etendue
