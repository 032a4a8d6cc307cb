// Sum of simple lobes with independent factors: `uber`, `plastic` and `translucent` of pbrt-v3.
//   diffuse_reflectance (0.25), diffuse_transmittance (0)      diffuse
//   glossy_reflectance (0.25), glossy_transmittance (0)        microfacets with a dielectric's Fresnel term
//   specular_reflectance (0), specular_transmittance (0)       the same, smooth
//   distribution (beckmann), alpha (0.1), or alpha_u, alpha_v  of the microfacets
//   eta (1.5)                                                  η below the surface over η above
// Colours or textures. Reflects on both sides. The factors may add up to more than 1; energy is then not conserved.

#include "bsdf/ior.h"

namespace etendue {
namespace {

class LobeSum final : public Material {
public:
    LobeSum(const Params& params, MaterialContext& context)
        : roughness_(params, context), eta_(params.number("eta", 1.5f, 0.01f, 100)),
          diffuse_(context.texture(params, "diffuse_reflectance", Rgb(0.25f), 1)),
          diffuse_transmission_(context.texture(params, "diffuse_transmittance", Rgb(0), 1)),
          glossy_(context.texture(params, "glossy_reflectance", Rgb(0.25f), 1)),
          glossy_transmission_(context.texture(params, "glossy_transmittance", Rgb(0), 1)),
          specular_(context.texture(params, "specular_reflectance", Rgb(0), 1)),
          specular_transmission_(context.texture(params, "specular_transmittance", Rgb(0), 1)) {
        if (may_have(glossy_transmission_) && eta_ == 1)
            params.fail("eta", "rough transmission needs an eta other than 1");
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        const Rgb d = diffuse_.eval(at), dt = diffuse_transmission_.eval(at), g = glossy_.eval(at),
                  gt = glossy_transmission_.eval(at), s = specular_.eval(at),
                  st = specular_transmission_.eval(at);
        // Shares of the samples, by what the lobes reflect at 60°.
        const float F = fresnel_dielectric(0.5f, eta_).R;
        const float share_d = d.mean() + dt.mean(), share_g = F * g.mean() + (1 - F) * gt.mean(),
                    share_s = F * s.mean() + (1 - F) * st.mean();
        const float sum = share_d + share_g + share_s;
        if (!(sum > 0)) return;
        const auto add = [&](const Frame& f, float share, const auto& make_lobe) {
            if (share > 0) list.add(f, make_lobe(sum / share), weight * share / sum);
        };
        // As in a two-sided material, reflection looks the same from behind.
        const Frame reflecting = sees_front(point, frame) ? frame : frame.flipped();
        if (dt.is_zero())
            add(reflecting, share_d, [&](float k) { return DiffuseLobe{d * k}; });
        else
            add(frame, share_d, [&](float k) { return DiffuseTransmissionLobe{d * k, dt * k}; });
        if (gt.is_zero())
            add(reflecting, share_g, [&](float k) {
                return RoughConductorLobe{roughness_.eval(at), Rgb(eta_), Rgb(0), g * k};
            });
        else
            add(frame, share_g, [&](float k) {
                return RoughDielectricLobe{roughness_.eval(at), eta_, g * k, gt * k};
            });
        if (st.is_zero())
            add(reflecting, share_s, [&](float k) {
                return ConductorLobe{Rgb(eta_), Rgb(0), s * k};
            });
        else
            add(frame, share_s, [&](float k) { return DielectricLobe{eta_, s * k, st * k}; });
    }
    bool is_transmissive() const override {
        return may_have(diffuse_transmission_) || may_have(glossy_transmission_) ||
               may_have(specular_transmission_);
    }
    bool is_two_sided() const override { return true; }
    bool may_be_smooth() const override {
        return may_have(diffuse_) || may_have(diffuse_transmission_) || may_have(glossy_) ||
               may_have(glossy_transmission_);
    }
    bool may_have_delta() const override {
        return may_have(specular_) || may_have(specular_transmission_);
    }
    int max_components() const override { return 3; }
    Rgb mean_albedo() const override {
        const float F = fresnel_dielectric(1, eta_).R;
        return diffuse_.mean() + diffuse_transmission_.mean() +
               (glossy_.mean() + specular_.mean()) * F +
               (glossy_transmission_.mean() + specular_transmission_.mean()) * (1 - F);
    }

private:
    static bool may_have(const TextureRef& t) { return !t.is_constant() || !t.mean().is_zero(); }

    Roughness roughness_;
    float eta_;
    TextureRef diffuse_, diffuse_transmission_, glossy_, glossy_transmission_, specular_,
        specular_transmission_;
};

}  // namespace

MaterialEntry lobesum_entry() {
    return {{"bsdf", "lobesum",
             "Sum of diffuse, glossy and specular lobes, each with its own factor.",
             concat({{{"diffuse_reflectance", ParamKind::Texture, "0.25",
                       "Albedo of the diffuse reflection."},
                      {"diffuse_transmittance", ParamKind::Texture, "0",
                       "Albedo of the diffuse transmission."},
                      {"glossy_reflectance", ParamKind::Texture, "0.25",
                       "Factor on the reflection of rough facets."},
                      {"glossy_transmittance", ParamKind::Texture, "0",
                       "Factor on the transmission of rough facets."},
                      {"specular_reflectance", ParamKind::Texture, "0",
                       "Factor on the mirror reflection."},
                      {"specular_transmittance", ParamKind::Texture, "0",
                       "Factor on the clear transmission."},
                      {"eta", ParamKind::Float, "1.5",
                       "Index of refraction below the surface divided by that above it."}},
                     roughness_params()})},
            make_material<LobeSum>};
}

}  // namespace etendue
