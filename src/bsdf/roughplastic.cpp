// Rough plastic: a rough dielectric coat over a diffuse base.
//   distribution (beckmann)     beckmann or ggx
//   alpha (0.1)                 roughness of the coat; number or texture
//   diffuse_reflectance (0.5)   colour or texture in [0, 1]
//   specular_reflectance (1)    colour or texture in [0, 1], factor on the reflection of the coat
//   int_ior (polypropylene), ext_ior (air)   indices of the coat and outside; numbers or names
//   nonlinear (false)           whether interreflection under the coat saturates the colour
//   thickness (0)               optical thickness of the coat
//   sample_visible (true)       accepted; visible normals are always sampled
// The rough transmittance is that of single scattering, as in Mitsuba 3: light scattered several times between facets
// is lost. Absorption in the coat follows the directions that a smooth coat refracts. Reciprocal. One-sided.

#include "bsdf/roughplastic.h"

#include "bsdf/ior.h"
#include "bsdf/plastic_params.h"

namespace etendue {

BsdfEval RoughPlasticLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    const Vec3 h = wo + wi, m = h / length(h);
    if (!(m.z > 0)) return {};  // opposite grazing directions: not resolved by float
    const float F = fresnel_dielectric(dot(wo, m), eta).R;
    const float To = RoughTransmittance::lookup(transmittance, wo.z);
    const float Ti = RoughTransmittance::lookup(transmittance, wi.z);
    const float qo = coat_probability(1 - To, specular_share),
                qi = coat_probability(1 - Ti, specular_share);
    const float attenuation =
        coat_attenuation(thickness, cos_below_coat(wo.z, eta), cos_below_coat(wi.z, eta));
    // With σ(w) = |cos θ| / G1(w): D G / (4 cos θo), and the density of reflection at visible normals.
    const float quarter_D = 0.25f * distribution.D(m), sigma_o = distribution.sigma(wo),
                sigma_i = distribution.sigma(wi);
    return {.f = specular * (F * quarter_D * wi.z / (sigma_o * sigma_i)) +
                 diffuse * (To * Ti * attenuation * wi.z * kInvPi),
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
        : params_(params, context), coat_(read_distribution(params),
                                          context.texture(params, "alpha", Rgb(0.1f)), params_.eta),
          least_loss_(loss_below_coat(params_.eta, params_.thickness)) {
        // Without a step of the index nothing is reflected.
        const float R = reflectance_below_coat(params_.eta, 0);
        if (R > 0) absorption_ = reflectance_below_coat(params_.eta, params_.thickness) / R;
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        const float alpha = coat_.alpha(at);
        const RoughTransmittance& T = coat_.transmittance(alpha);
        const auto [diffuse, specular, share] =
            params_.eval(at, std::max(1 - T.internal_reflectance() * absorption_, least_loss_));
        list.add(frame,
                 RoughPlasticLobe{diffuse, specular, coat_.distribution(alpha), params_.eta, share,
                                  params_.thickness, T.table()},
                 weight);
    }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override { return params_.mean_albedo(); }

private:
    PlasticParams params_;
    RoughCoat coat_;
    /// Factor of the internal reflectance by absorption in the coat: that of a smooth coat.
    float absorption_ = 1;
    /// Of a smooth coat, which reflects more; the loss of a rough one is rounded where η is large.
    float least_loss_;
};

}  // namespace

MaterialEntry roughplastic_entry() {
    return {{"bsdf", "roughplastic", "Rough dielectric coat over a diffuse base.",
             concat({PlasticParams::table(),
                     {{"distribution", ParamKind::String, "beckmann",
                       "Distribution of facet normals: beckmann or ggx."},
                      {"alpha", ParamKind::Texture, "0.1",
                       "Roughness of the coat: RMS slope of its facets."},
                      {"sample_visible", ParamKind::Bool, "true",
                       "Accepted; visible normals are always sampled."}}})},
            make_material<RoughPlastic>};
}

}  // namespace etendue
