// Rough boundary between two dielectrics, such as ground glass; single scattering only.
//   distribution (beckmann)            beckmann or ggx
//   alpha (0.1), or alpha_u, alpha_v   RMS slope of the facets along the tangents; or textures
//   int_ior (bk7), ext_ior (air)       indices behind and in front; numbers or names; not equal
//   specular_reflectance (1), specular_transmittance (1)   factors; only 1 is physical
//   sample_visible (true)              accepted; visible normals are always sampled
// References: [Walter et al. 2007], [Heitz 2014]. Light scattered several times between facets is lost.

#include "bsdf/roughdielectric.h"

#include "bsdf/ior.h"

namespace etendue {

namespace {

/// D(m), σ(wo) and σ(wi) of one facet and one pair of directions, from which value and densities of reflection and
/// refraction follow.
struct Facet {
    float D, sigma_o, sigma_i;

    /// wi mirrors wo. pdf = F D_wo(m) / (4 |wo·m|) = F D / (4 σ_o).
    BsdfEval reflection(Rgb reflectance, float cos_i, float F) const {
        const float FD = 0.25f * F * D, pdf = FD / sigma_o;
        return {reflectance * (pdf * (std::fabs(cos_i) / sigma_i)), pdf, FD / sigma_i};
    }
    /// pdf = (1 − F) D_wo(m) dω_m/dω_i with dω_m/dω_i = |wi·m| / (wi·m + wo·m / η)² [Walter et al.
    /// 2007, eq. 17], `eta` being η on wi's side over η on wo's; from wi the same with 1/η.
    BsdfEval refraction(Rgb transmittance, float cos_i, float wo_m, float wi_m, float eta) const {
        const float T = fresnel_transmittance(wo_m, wi_m, eta);
        const float TD = T * D * std::fabs(wo_m * wi_m) / sqr(wi_m + wo_m / eta),
                    pdf = TD / sigma_o;
        return {transmittance * (pdf * (std::fabs(cos_i) / sigma_i)), pdf,
                TD / (sigma_i * sqr(eta)), eta};
    }
};

}  // namespace

BsdfEval RoughDielectricLobe::eval(Vec3 wo, Vec3 wi) const {
    if (wo.z == 0 || wi.z == 0) return {};
    const bool is_reflection = (wo.z > 0) == (wi.z > 0);
    const float eta_io = is_reflection ? 1 : wo.z > 0 ? eta : 1 / eta;
    Vec3 m = wo + wi * eta_io;
    const float len2 = length2(m);
    if (!(len2 > 0)) return {};
    m = m * (std::copysign(1 / std::sqrt(len2), m.z));
    const float wo_m = dot(wo, m), wi_m = dot(wi, m);
    // Each direction must see the same side of the facet and of the surface.
    if (!(wo_m * wo.z > 0 && wi_m * wi.z > 0)) return {};
    const float D = distribution.D(m);
    if (!(D > 0)) return {};
    const Facet facet{D, distribution.sigma(wo), distribution.sigma(wi)};
    return is_reflection ? facet.reflection(reflectance, wi.z, fresnel_dielectric(wo_m, eta).R)
                         : facet.refraction(transmittance, wi.z, wo_m, wi_m, eta_io);
}

std::optional<BsdfSample> RoughDielectricLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (wo.z == 0) return {};
    const Vec3 m = distribution.sample_visible(wo.z > 0 ? wo : -wo, u);
    const float wo_m = dot(wo, m);
    const DielectricFresnel fresnel = fresnel_dielectric(wo_m, eta);
    const bool is_reflection = u_lobe < fresnel.R;
    const Vec3 wi = normalize(is_reflection ? reflect(wo, m) : refract(wo, m, fresnel));
    if (wi.z == 0 || ((wo.z > 0) == (wi.z > 0)) != is_reflection) return {};
    const Facet facet{distribution.D(m), distribution.sigma(wo), distribution.sigma(wi)};
    const BsdfEval e =
        is_reflection ? facet.reflection(reflectance, wi.z, fresnel.R)
                      : facet.refraction(transmittance, wi.z, wo_m, fresnel.cos_t, fresnel.eta);
    if (!(e.pdf > 0)) return {};
    // All but the masking G1(wi) = |cos θ_i| / σ_i cancels from f / pdf.
    return BsdfSample{.wi = wi,
                      .weight = (is_reflection ? reflectance : transmittance) *
                                (std::fabs(wi.z) / facet.sigma_i),
                      .pdf = e.pdf,
                      .pdf_rev = e.pdf_rev,
                      .eta = e.eta};
}

namespace {

class RoughDielectric final : public Material {
public:
    RoughDielectric(const Params& params, MaterialContext& context)
        : roughness_(params, context), eta_(read_relative_ior(params)),
          reflectance_(context.texture(params, "specular_reflectance", Rgb(1))),
          transmittance_(context.texture(params, "specular_transmittance", Rgb(1))) {
        if (eta_ == 1)
            params.fail("bsdf \"roughdielectric\" needs different \"int_ior\" and \"ext_ior\" (use "
                        "\"null\")");
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        list.add(frame,
                 RoughDielectricLobe{roughness_.eval(at), eta_, reflectance_.eval(at),
                                     transmittance_.eval(at)},
                 weight);
    }
    bool is_transmissive() const override { return true; }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override {
        return RoughDielectricLobe{{}, eta_, reflectance_.mean(), transmittance_.mean()}
            .albedo_estimate();
    }

private:
    Roughness roughness_;
    float eta_;
    TextureRef reflectance_, transmittance_;
};

}  // namespace

MaterialEntry roughdielectric_entry() {
    return {{"bsdf", "roughdielectric",
             "Rough boundary between two dielectrics [Walter et al. 2007].",
             concat({roughness_params(), dielectric_params()})},
            make_material<RoughDielectric>};
}

}  // namespace etendue
