// Modified Phong model [Lafortune & Willems 1994], made reciprocal: a diffuse part and a cosine
// lobe about the mirror direction, as in Mitsuba 0.6.
//   diffuse_reflectance (0.5)   colour or texture in [0, 1]
//   specular_reflectance (0.2)  colour or texture in [0, 1]
//   exponent (30)               number or texture, 0 to 1e8
// Where the sum of the two colours exceeds one, both are scaled down. The part of the lobe below the surface is lost.
// One-sided.

#include "bsdf/phong.h"

#include "bsdf/material.h"
#include "math/warp.h"

namespace etendue {

BsdfEval PhongLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    // cos α = 1 − |r − wi|²/2, where a sharp lobe needs more digits than a product of unit vectors has.
    const float versine = 0.5f * length2(reflect(wo) - wi);
    const float lobe =
        versine < 1 ? std::exp(exponent * std::log1p(-versine)) * (0.5f * kInvPi) : 0;
    const float specular_pdf = specular_probability * (exponent + 1) * lobe;
    const float diffuse_share = (1 - specular_probability) * kInvPi;
    return {.f = (diffuse * kInvPi + specular * ((exponent + 2) * lobe)) * wi.z,
            .pdf = specular_pdf + diffuse_share * wi.z,
            .pdf_rev = specular_pdf + diffuse_share * wo.z};
}

std::optional<BsdfSample> PhongLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (!(wo.z > 0)) return {};
    if (u_lobe >= specular_probability) {
        const Vec3 wi = sample_cosine_hemisphere(u);
        return make_sample(wi, eval(wo, wi));
    }
    // Density (n + 1)/(2π) cosⁿ α about the mirror direction; directions below the surface end the walk.
    const float log_cos = std::log(u.x) / (exponent + 1), cos_alpha = std::exp(log_cos),
                sin_alpha = std::sqrt(-std::expm1(2 * log_cos));
    float s, c;
    sincosf(2 * kPi * u.y, &s, &c);
    const Vec3 wi = normalize(
        Frame::from_normal(reflect(wo)).to_world({sin_alpha * c, sin_alpha * s, cos_alpha}));
    return make_sample(wi, eval(wo, wi));
}

namespace {

/// Directions in single precision do not resolve sharper lobes.
constexpr float kMaxExponent = 1e8f;

class Phong final : public Material {
public:
    Phong(const Params& params, MaterialContext& context)
        : diffuse_(context.texture(params, "diffuse_reflectance", Rgb(0.5f), 1)),
          specular_(context.texture(params, "specular_reflectance", Rgb(0.2f), 1)),
          exponent_(context.texture(params, "exponent", Rgb(30), kMaxExponent)) {}

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const Rgb d = diffuse_.eval(point.texture_point()),
                  s = specular_.eval(point.texture_point());
        const float excess = std::max((d + s).max(), 1.0f), sum = d.mean() + s.mean();
        list.add(frame,
                 PhongLobe{.diffuse = d / excess,
                           .specular = s / excess,
                           .exponent = exponent_.eval_scalar(point.texture_point()),
                           .specular_probability = sum > 0 ? s.mean() / sum : 0},
                 weight);
    }
    bool may_have_delta() const override { return false; }
    Rgb mean_albedo() const override {
        const Rgb sum = diffuse_.mean() + specular_.mean();
        return sum / std::max(sum.max(), 1.0f);
    }

private:
    TextureRef diffuse_, specular_, exponent_;
};

}  // namespace

MaterialEntry phong_entry() {
    return {{"bsdf",
             "phong",
             "Modified Phong model: a diffuse part and a cosine lobe about the mirror direction "
             "[Lafortune & Willems 1994].",
             {{"diffuse_reflectance", ParamKind::Texture, "0.5",
               "Albedo of the diffuse part, in [0, 1]."},
              {"specular_reflectance", ParamKind::Texture, "0.2",
               "Albedo of the lobe at normal incidence, in [0, 1]."},
              {"exponent", ParamKind::Texture, "30", "Exponent of the lobe's cosine, 0 to 1e8."}}},
            make_material<Phong>};
}

}  // namespace etendue
