// Rough plastic: a rough dielectric coat over a diffuse base.
//   distribution (beckmann)     beckmann or ggx
//   alpha (0.1)                 roughness of the coat; number or texture
//   diffuse_reflectance (0.5)   colour or texture in [0, 1]
//   specular_reflectance (1)    colour or texture in [0, 1], factor on the reflection of the coat
//   int_ior (polypropylene), ext_ior (air)   indices of the coat and outside; numbers or names
//   nonlinear (false)           whether interreflection under the coat saturates the colour
//   sample_visible (true)       accepted; visible normals are always sampled
// The rough transmittance is that of single scattering, as in Mitsuba 3: light scattered several times between facets
// is lost. Reciprocal. One-sided.

#include "bsdf/roughplastic.h"

#include <map>
#include <tuple>

#include "bsdf/ior.h"
#include "bsdf/plastic_params.h"

namespace etendue {
namespace {

/// Mean of `value(m)` over the facets m visible from `wo`, by the midpoint rule with n × n points.
template <class F>
double mean_over_visible_normals(int n, const Microfacet& distribution, Vec3 wo, const F& value) {
    double sum = 0;
    for (int i = 0; i < n * n; ++i)
        sum += value(distribution.sample_visible(
            wo, {(float(i % n) + 0.5f) / float(n), (float(i / n) + 0.5f) / float(n)}));
    return sum / (n * n);
}

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

const RoughTransmittance& SharedTransmittance::make() const {
    const std::lock_guard lock(making_);
    if (!value_) value_.emplace(distribution_, eta_);
    made_.store(&*value_, std::memory_order_release);
    return *value_;
}

BsdfEval RoughPlasticLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    const Vec3 h = wo + wi, m = h / length(h);
    if (!(m.z > 0)) return {};  // opposite grazing directions: not resolved by float
    const float F = fresnel_dielectric(dot(wo, m), eta).R;
    const float To = RoughTransmittance::lookup(transmittance, wo.z);
    const float Ti = RoughTransmittance::lookup(transmittance, wi.z);
    const float qo = coat_probability(1 - To, specular_share),
                qi = coat_probability(1 - Ti, specular_share);
    // With σ(w) = |cos θ| / G1(w): D G / (4 cos θo), and the density of reflection at visible normals.
    const float quarter_D = 0.25f * distribution.D(m), sigma_o = distribution.sigma(wo),
                sigma_i = distribution.sigma(wi);
    return {.f = specular * (F * quarter_D * wi.z / (sigma_o * sigma_i)) +
                 diffuse * (To * Ti * wi.z * kInvPi),
            .pdf = qo * quarter_D / sigma_o + (1 - qo) * wi.z * kInvPi,
            .pdf_rev = qi * quarter_D / sigma_i + (1 - qi) * wo.z * kInvPi};
}

std::optional<BsdfSample> RoughPlasticLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (!(wo.z > 0)) return {};
    const float q =
        coat_probability(1 - RoughTransmittance::lookup(transmittance, wo.z), specular_share);
    const Vec3 wi = u_lobe < q ? normalize(reflect(wo, distribution.sample_visible(wo, u)))
                               : sample_cosine_hemisphere(u);
    return make_sample(wi, eval(wo, wi));
}

namespace {

class RoughPlastic final : public Material {
public:
    RoughPlastic(const Params& params, MaterialContext& context)
        : params_(params, context), kind_(read_distribution(params)),
          alpha_(context.texture(params, "alpha", Rgb(0.1f))) {
        const auto add = [&](float alpha) {
            transmittance_.push_back(SharedTransmittance::of(kind_, alpha, params_.eta));
        };
        if (alpha_.is_constant())
            add(alpha_.eval_scalar(Vec2()));
        else
            for (int i = 0; i < kRows; ++i) add(sqr(float(i) / (kRows - 1)));
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        const float alpha = alpha_.eval_scalar(at);
        const RoughTransmittance& T = transmittance(alpha);
        const auto [diffuse, specular, share] = params_.eval(at, T.internal_reflectance());
        list.add(frame,
                 RoughPlasticLobe{diffuse, specular, coat(alpha), params_.eta, share, T.table()},
                 weight);
    }
    Rgb mean_albedo() const override { return params_.mean_albedo(); }

private:
    /// Number of roughnesses for which a textured α has transmittances; they are equidistant in √α.
    static constexpr int kRows = 33;

    Microfacet coat(float alpha) const { return {kind_, alpha, alpha}; }
    /// The transmittance for the nearest of these roughnesses: the same for both ends of a path.
    const RoughTransmittance& transmittance(float alpha) const {
        if (transmittance_.size() == 1) return transmittance_.front()->get();
        const float row = std::sqrt(clamp(alpha, 0, 1)) * (kRows - 1) + 0.5f;
        return transmittance_[std::min(size_t(row), size_t(kRows - 1))]->get();
    }

    PlasticParams params_;
    Microfacet::Kind kind_;
    TextureRef alpha_;
    std::vector<std::shared_ptr<const SharedTransmittance>> transmittance_;
};

}  // namespace

MaterialEntry roughplastic_entry() {
    return {{"bsdf", "roughplastic", "Rough dielectric coat over a diffuse base.",
             concat(PlasticParams::table(), {{"distribution", ParamKind::String, "beckmann",
                                              "Distribution of facet normals: beckmann or ggx."},
                                             {"alpha", ParamKind::Texture, "0.1",
                                              "Roughness of the coat: RMS slope of its facets."},
                                             {"sample_visible", ParamKind::Bool, "true",
                                              "Accepted; visible normals are always sampled."}})},
            make_material<RoughPlastic>};
}

}  // namespace etendue
