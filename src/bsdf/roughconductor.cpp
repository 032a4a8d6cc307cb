// Rough metal: a microfacet surface with the Fresnel reflectance of a conductor, single scattering
// only.
//   distribution (beckmann)            beckmann or ggx
//   alpha (0.1), or alpha_u, alpha_v   RMS slope of the facets along the tangents; or textures
//   material (none), or eta, k         named metal, "none" for reflectance 1, or its complex index
//   specular_reflectance (1)           factor of the reflectance; only 1 is physical
//   sample_visible (true)              accepted; visible normals are always sampled
// References: [Walter et al. 2007], [Heitz 2014]. One-sided; separable Smith masking. Light scattered several times
// between facets is lost, which visibly darkens metals with alpha above about 0.3.

#include "bsdf/roughconductor.h"

#include "bsdf/ior.h"

namespace etendue {

// With σ of microfacet.h: f |cos θ_i| = ρ F D |cos θ_i| / (4 σ_o σ_i) and pdf = D_wo(m) / (4 wo·m)
// = D / (4 σ_o).

BsdfEval RoughConductorLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    const Vec3 m = normalize(wo + wi);
    const float quarter_D = 0.25f * distribution.D(m);
    const float sigma_o = distribution.sigma(wo), sigma_i = distribution.sigma(wi);
    const float pdf = quarter_D / sigma_o;
    return {reflectance * fresnel_conductor(dot(wo, m), eta, k) * (pdf * (wi.z / sigma_i)), pdf,
            quarter_D / sigma_i};
}

std::optional<BsdfSample> RoughConductorLobe::sample(Vec3 wo, float /*u_lobe*/, Vec2 u) const {
    if (!(wo.z > 0)) return {};
    const Vec3 m = distribution.sample_visible(wo, u);
    const Vec3 wi = normalize(reflect(wo, m));
    if (!(wi.z > 0)) return {};
    const float quarter_D = 0.25f * distribution.D(m);
    if (!(quarter_D > 0)) return {};
    const float sigma_i = distribution.sigma(wi);
    return BsdfSample{.wi = wi,
                      .weight =
                          reflectance * fresnel_conductor(dot(wo, m), eta, k) * (wi.z / sigma_i),
                      .pdf = quarter_D / distribution.sigma(wo),
                      .pdf_rev = quarter_D / sigma_i};
}

namespace {

class RoughConductor final : public Material {
public:
    RoughConductor(const Params& params, MaterialContext& context)
        : roughness_(params, context), ior_(params, context),
          reflectance_(context.texture(params, "specular_reflectance", Rgb(1))) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        list.add(frame,
                 RoughConductorLobe{roughness_.eval(at), ior_.eta.eval(at), ior_.k.eval(at),
                                    reflectance_.eval(at)},
                 weight);
    }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override {
        return reflectance_.mean() * fresnel_conductor(1, ior_.eta.mean(), ior_.k.mean());
    }

private:
    Roughness roughness_;
    ConductorIndex ior_;
    TextureRef reflectance_;
};

}  // namespace

MaterialEntry roughconductor_entry() {
    return {{"bsdf", "roughconductor", "Rough metal [Walter et al. 2007].",
             concat({roughness_params(), conductor_params()})},
            make_material<RoughConductor>};
}

}  // namespace etendue
