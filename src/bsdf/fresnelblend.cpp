// Glossy coat over a diffuse base with Schlick's Fresnel term [Ashikhmin & Shirley 2000]; `substrate` of pbrt-v3.
//   diffuse_reflectance (0.5)    colour or texture in [0, 1]
//   specular_reflectance (0.5)   colour or texture in [0, 1], of the coat at normal incidence
//   distribution (beckmann)            beckmann or ggx
//   alpha (0.1), or alpha_u, alpha_v   roughness of the coat along the tangents; or textures
// Reciprocal. One-sided.

#include "bsdf/fresnelblend.h"

#include "bsdf/ior.h"

namespace etendue {
namespace {

float pow5(float x) {
    return sqr(sqr(x)) * x;
}

}  // namespace

BsdfEval FresnelBlendLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    const Vec3 h = wo + wi, m = h / length(h);
    const float cos_d = dot(wi, m);
    if (!(m.z > 0 && cos_d > 0)) return {};  // both grazing and opposite, beyond the range of float
    const float base = 28 / (23 * kPi) * (1 - pow5(1 - 0.5f * wi.z)) * (1 - pow5(1 - 0.5f * wo.z));
    const Rgb fresnel = specular + (Rgb(1) - specular) * pow5(1 - cos_d);
    const float quarter_D = 0.25f * distribution.D(m);
    const float q = kSpecularShare;
    return {.f = (diffuse * (Rgb(1) - specular) * base +
                  fresnel * (quarter_D / (cos_d * std::fmax(wi.z, wo.z)))) *
                 wi.z,
            .pdf = q * quarter_D / distribution.sigma(wo) + (1 - q) * wi.z * kInvPi,
            .pdf_rev = q * quarter_D / distribution.sigma(wi) + (1 - q) * wo.z * kInvPi};
}

std::optional<BsdfSample> FresnelBlendLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (!(wo.z > 0)) return {};
    const Vec3 wi = u_lobe < kSpecularShare
                        ? normalize(reflect(wo, distribution.sample_visible(wo, u)))
                        : sample_cosine_hemisphere(u);
    return make_sample(wi, eval(wo, wi));
}

namespace {

class FresnelBlend final : public Material {
public:
    FresnelBlend(const Params& params, MaterialContext& context)
        : roughness_(params, context),
          diffuse_(context.texture(params, "diffuse_reflectance", Rgb(0.5f), 1)),
          specular_(context.texture(params, "specular_reflectance", Rgb(0.5f), 1)) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        list.add(frame,
                 FresnelBlendLobe{diffuse_.eval(point.texture_point()),
                                  specular_.eval(point.texture_point()),
                                  roughness_.eval(point.texture_point())},
                 weight);
    }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override {
        return specular_.mean() + diffuse_.mean() * (Rgb(1) - specular_.mean());
    }

private:
    Roughness roughness_;
    TextureRef diffuse_, specular_;
};

}  // namespace

MaterialEntry fresnelblend_entry() {
    return {{"bsdf", "fresnelblend", "Glossy coat over a diffuse base [Ashikhmin & Shirley 2000].",
             concat({{{"diffuse_reflectance", ParamKind::Texture, "0.5",
                       "Albedo of the base, in [0, 1]."},
                      {"specular_reflectance", ParamKind::Texture, "0.5",
                       "Reflectance of the coat at normal incidence, in [0, 1]."}},
                     roughness_params()})},
            make_material<FresnelBlend>};
}

}  // namespace etendue
