// Metal below a clear or absorbing dielectric coat, like `coatedconductor` of pbrt-v4, in closed form.
//   distribution (beckmann)              beckmann or ggx; of the metal and of the coat
//   alpha (0.1), or alpha_u, alpha_v     roughness of the metal; 0 is smooth
//   coat_alpha (0)                       roughness of the coat; 0 is smooth
//   material (none), or eta, k           named metal, "none" for reflectance 1, or its complex index
//   reflectance                          instead of these: the metal's reflectance at normal incidence in air
//   int_ior (bk7), ext_ior (air)         indices of the coat and outside
//   thickness (0)                        optical thickness of the coat: thickness times absorption coefficient
// Exact for a smooth coat over a smooth metal. A rough metal below a smooth coat: exact for light reflected once by the
// metal. Light that it reflects beyond the critical angle of the coat leaves after further reflections; a lobe that
// knows nothing of its first direction returns it, see TrappedLight. The albedo is that of walks between coat and metal
// within −1.1 and 3.2 % for α from 0.05 to 0.8. A rough coat refracts as a smooth one does, with the transmittance of a
// rough one, and widens the lobe of the metal: facets of slope s turn refracted light by (1 − 1/η) s, twice, and the
// metal's facets by 2s, so the squares of the roughnesses add as α² + (1 − 1/η)² α_coat² / 2. Where a roughness is
// textured, trapped light has that of the nearest of 33 values. Reciprocal; loses energy but never gains any. One-sided.

#include "bsdf/coatedconductor.h"

#include <fmt/format.h>

#include "bsdf/ior.h"
#include "bsdf/material.h"
#include "math/warp.h"

namespace etendue {

TrappedLight::TrappedLight(const Microfacet& metal, float eta, float thickness,
                           const float* transmittance)
    : transmittance_(transmittance) {
    constexpr int kPoints = 48;
    constexpr float kGrazing = 1e-4f, kLeast = 1e-5f;
    const auto at = [](float cos) { return Vec3{std::sqrt((1 - cos) * (1 + cos)), 0, cos}; };
    // What the coat lets out of light with this cosine inside.
    const auto T_out = [&](float inside) {
        const float sin2 = sqr(eta) * (1 - inside) * (1 + inside);
        return sin2 < 1 ? coat_transmittance(transmittance, std::sqrt(1 - sin2), eta) : 0.0f;
    };
    // Mean of the values of the directions into which the metal reflects light from the direction o inside.
    const auto mean_reflected = [&](Vec3 o, const auto& value) {
        return mean_over_visible_normals(kPoints, metal, o, [&](Vec3 m) {
            const Vec3 i = reflect(o, m);
            return i.z > 0 ? metal.G1(i) * value(i.z) : 0.0f;
        });
    };
    double mean = 0, trapped = 0, reflected = 0, out = 0;
    for (int j = 0; j < kSize; ++j) {
        // The trapezoidal rule over the cosines outside, and the midpoint rule over those inside.
        const float cos = std::fmax(float(j) / (kSize - 1), kGrazing),
                    half = j == kSize - 1 ? 1 : 2;
        const float To = coat_transmittance(transmittance, cos, eta);
        share_[size_t(j)] = float(mean_reflected(at(cos_below_coat(cos, eta)), [&](float inside) {
            const float Ti = T_out(inside);
            return Ti > 0 ? 1 - Ti / (1 - std::fmin(1 - To, 1 - Ti)) : 1.0f;
        }));
        mean += double(half * To * share_[size_t(j)] * cos) / (kSize - 1);
        // Diffuse light, as far as the coat has reflected it.
        const float inside = (float(j) + 0.5f) / kSize;
        const double weight = double(inside * (1 - T_out(inside)));
        trapped += weight;
        reflected += weight * double(coat_attenuation(thickness, inside, inside)) *
                     mean_reflected(at(inside), [](float) { return 1.0f; });
        out += weight * double(coat_attenuation(thickness, inside, inside)) *
               mean_reflected(at(inside), T_out);
    }
    mean_ = float(mean);
    if (mean_ < kLeast) share_.fill(0);
    survival_ = trapped > 0 ? float(reflected / trapped) : 0;
    escape_ = reflected > 0 ? float(out / reflected) : 0;
}

Rgb TrappedLight::returned(Rgb metal_eta, Rgb metal_k) const {
    // 2 ∫ F(μ) μ dμ with two points of Gauss and Jacobi.
    const Rgb F = 0.363917f * fresnel_conductor(0.355051f, metal_eta, metal_k) +
                  0.636083f * fresnel_conductor(0.844949f, metal_eta, metal_k);
    // Each time the metal reflects what survives, and the coat keeps 1 − escape of it.
    const Rgb again = F * survival_;
    return F * again * (escape_ / mean_) / (Rgb(1) - again * (1 - escape_));
}

BsdfEval CoatedConductorLobe::eval(Vec3 wo, Vec3 wi) const {
    if (!(wo.z > 0 && wi.z > 0)) return {};
    const float To = T(wo.z), Ti = T(wi.z);
    const Vec3 o = below(wo), i = below(wi), m = normalize(o + i);
    // As for a RoughConductorLobe between o and i. With cos θi dωi = η² cos θ'i dω'i the densities change by
    // cos θi / (η² cos θ'i), and so does f |cos θi|.
    const float quarter_D = 0.25f * metal.D(m), sigma_o = metal.sigma(o), sigma_i = metal.sigma(i);
    const float to_outside = 1 / sqr(eta);
    const float pdf = quarter_D / sigma_o * (to_outside * wi.z / i.z),
                pdf_rev = quarter_D / sigma_i * (to_outside * wo.z / o.z);
    const Rgb R = coated_reflectance(fresnel_conductor(dot(o, m), metal_eta, metal_k), To, Ti,
                                     coat_attenuation(thickness, o.z, i.z));
    const float so = trapped->share(wo.z), si = trapped->share(wi.z);
    BsdfEval e{.f = R * (pdf * (i.z / sigma_i)),
               .pdf = To * lerp(so, pdf, wi.z * kInvPi),
               .pdf_rev = Ti * lerp(si, pdf_rev, wo.z * kInvPi)};
    if (so > 0 && si > 0)
        e.f += trapped->returned(metal_eta, metal_k) *
               (To * so * Ti * si * coat_attenuation(thickness, o.z, i.z) * wi.z * kInvPi);
    if (!is_rough()) return e;
    const Vec3 h = wo + wi, mc = h / length(h);
    if (!(mc.z > 0)) return e;  // opposite grazing directions: not resolved by float
    const Microfacet facets = coat();
    const float quarter_Dc = 0.25f * facets.D(mc), sigma_co = facets.sigma(wo),
                sigma_ci = facets.sigma(wi);
    const float F = fresnel_dielectric(dot(wo, mc), eta).R;
    e.f += Rgb(F * quarter_Dc * wi.z / (sigma_co * sigma_ci));
    e.pdf += (1 - To) * quarter_Dc / sigma_co;
    e.pdf_rev += (1 - Ti) * quarter_Dc / sigma_ci;
    return e;
}

std::optional<BsdfSample> CoatedConductorLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (!(wo.z > 0)) return {};
    const float To = T(wo.z);
    if (u_lobe < 1 - To) {
        if (!is_rough()) return delta_event(wo, false);
        const Vec3 wi = normalize(reflect(wo, coat().sample_visible(wo, u)));
        return make_sample(wi, eval(wo, wi));
    }
    if (u_lobe < 1 - To + To * trapped->share(wo.z)) {
        const Vec3 wi = sample_cosine_hemisphere(u);
        return make_sample(wi, eval(wo, wi));
    }
    const Vec3 o = below(wo), i = reflect(o, metal.sample_visible(o, u));
    const float sin2 = sqr(eta) * (sqr(i.x) + sqr(i.y));
    if (!(i.z > 0 && sin2 < 1)) return {};
    const Vec3 wi = normalize(Vec3{i.x * eta, i.y * eta, std::sqrt(1 - sin2)});
    return make_sample(wi, eval(wo, wi));
}

std::optional<BsdfSample> CoatedConductorLobe::delta_event(Vec3 wo, bool transmits) const {
    if (!(wo.z > 0) || transmits || is_rough()) return {};
    const float F = fresnel_dielectric(wo.z, eta).R;
    if (!(F > 0)) return {};
    return BsdfSample{
        .wi = reflect(wo), .weight = Rgb(1), .pdf = F, .pdf_rev = F, .is_delta = true};
}

float CoatedConductorLobe::max_pdf(Vec3 wo, const DirectionCone& c) const {
    if (!(wo.z > 0)) return 0;
    // Refraction into the coat contracts distances between directions above it, and cos θi <= cos θ'i.
    const DirectionCone inside =
        c.axis.z > 0 ? DirectionCone{below(c.axis), c.angle} : DirectionCone{Vec3{0, 0, 1}, kPi};
    const float To = T(wo.z);
    float bound =
        To * lerp(trapped->share(wo.z), metal.max_pdf_of_reflection(below(wo), inside) / sqr(eta),
                  std::fmax(c.max_cos({0, 0, 1}), 0.0f) * kInvPi);
    if (is_rough()) bound += (1 - To) * coat().max_pdf_of_reflection(wo, c);
    return bound;
}

Rgb CoatedConductorLobe::albedo_estimate() const {
    const float t = T(1);
    return Rgb(1 - t) + coated_reflectance(fresnel_conductor(1, metal_eta, metal_k), t, t,
                                           coat_attenuation(thickness, 1, 1));
}

namespace {

class CoatedConductor final : public Material {
public:
    CoatedConductor(const Params& params, MaterialContext& context)
        : roughness_(params, context), ior_(params, context), eta_(read_relative_ior(params)),
          coat_inside_(read_ior(params, "int_ior", "bk7")),
          thickness_(params.number("thickness", 0, 0)) {
        if (eta_ < 1)
            params.fail("int_ior",
                        fmt::format("the index of the coat is {} times that outside, but must "
                                    "not be below it",
                                    eta_));
        if (params.has("reflectance")) {
            if (params.has("material") || params.has("eta") || params.has("k"))
                params.fail("reflectance", "give either \"reflectance\", or the metal, not both");
            reflectance_ = context.texture(params, "reflectance", Rgb(1), 1);
        }
        const TextureRef coat = context.texture(params, "coat_alpha", Rgb(0));
        if (!(coat.is_constant() && coat.eval_scalar(Vec2()) == 0))
            coat_.emplace(read_distribution(params), coat, eta_);
        is_mirror_ = !coat_ && roughness_.is_zero();
        if (!(roughness_.is_constant() && coat.is_constant())) metal_rows_ = kAlphaRows;
        trapped_ = std::make_unique<MadeOnce<TrappedLight>[]>(metal_rows_ * coat_rows());
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        const auto [metal_eta, metal_k] = metal(at);
        if (is_mirror_) {
            list.add(frame, CoatedMirrorLobe{metal_eta, metal_k, eta_, thickness_}, weight);
            return;
        }
        const Microfacet facets = roughness_.eval(at);
        CoatedConductorLobe lobe{.metal = facets,
                                 .metal_eta = metal_eta,
                                 .metal_k = metal_k,
                                 .eta = eta_,
                                 .thickness = thickness_,
                                 .coat_alpha = 0,
                                 .trapped = nullptr};
        if (coat_) {
            lobe.coat_alpha = coat_->alpha(at);
            const float blur2 = 0.5f * sqr((1 - 1 / eta_) * lobe.coat_alpha);
            lobe.metal = {facets.kind(), std::sqrt(sqr(facets.alpha_x()) + blur2),
                          std::sqrt(sqr(facets.alpha_y()) + blur2)};
        }
        lobe.trapped = &trapped(lobe.metal, lobe.coat_alpha);
        list.add(frame, lobe, weight);
    }
    bool may_be_smooth() const override { return !is_mirror_; }
    Rgb mean_albedo() const override {
        const auto [metal_eta, metal_k] = metal(TexturePoint());
        return CoatedMirrorLobe{metal_eta, metal_k, eta_, thickness_}.albedo_estimate();
    }

private:
    size_t coat_rows() const { return coat_ ? coat_->rows() : 1; }
    /// That of facets of the smaller roughness of the metal, which traps less, or of the nearest one that has a table.
    const TrappedLight& trapped(const Microfacet& metal, float coat_alpha) const {
        const bool one = metal_rows_ == 1;
        const size_t metal_row = one ? 0 : alpha_row(metal.min_alpha()),
                     coat_row = coat_ ? coat_->row(coat_alpha) : 0;
        return trapped_[metal_row * coat_rows() + coat_row].get([&] {
            const float alpha = one ? metal.min_alpha() : alpha_of_row(metal_row);
            return TrappedLight({metal.kind(), alpha, alpha}, eta_, thickness_,
                                coat_ ? coat_->transmittance(coat_alpha).table() : nullptr);
        });
    }
    struct Index {
        Rgb eta, k;
    };
    /// Index of the metal over that of the coat.
    Index metal(const TexturePoint& at) const {
        Rgb eta(1), k;
        if (reflectance_) {
            const Rgb R = reflectance_->eval(at);
            for (int c = 0; c < 3; ++c) k[c] = k_of_reflectance(R[c]);
        } else {
            eta = ior_.eta.eval(at);
            k = ior_.k.eval(at);
        }
        return {eta / coat_inside_, k / coat_inside_};
    }
    /// With η = 1, a metal of normal reflectance R has k = 2 √R / √(1 − R).
    static float k_of_reflectance(float R) {
        const float r = clamp(R, 0, 0.9999f);
        return 2 * std::sqrt(r / (1 - r));
    }

    Roughness roughness_;
    ConductorIndex ior_;
    std::optional<TextureRef> reflectance_;
    float eta_;  ///< η of the coat over η outside.
    float coat_inside_, thickness_;
    std::optional<RoughCoat> coat_;
    bool is_mirror_;
    size_t metal_rows_ = 1;
    std::unique_ptr<MadeOnce<TrappedLight>[]> trapped_;  ///< By rows of the metal and of the coat.
};

}  // namespace

MaterialEntry coatedconductor_entry() {
    return {
        {"bsdf", "coatedconductor", "Metal below a dielectric coat.",
         concat(
             {roughness_params(),
              {{"coat_alpha", ParamKind::Texture, "0", "Roughness of the coat; 0 is smooth."},
               {"material", ParamKind::String, "none", "Named metal, or none for reflectance 1."},
               {"eta", ParamKind::Texture, "0", "Real part of the metal's index."},
               {"k", ParamKind::Texture, "1", "Imaginary part of the metal's index."},
               {"reflectance", ParamKind::Texture, "",
                "Reflectance of the metal at normal incidence in air, instead of material, eta "
                "and k."},
               {"int_ior", ParamKind::FloatOrName, "bk7",
                "Index of refraction of the coat, at least that outside."},
               {"ext_ior", ParamKind::FloatOrName, "air", "Index of refraction outside."},
               {"thickness", ParamKind::Float, "0",
                "Optical thickness of the coat: its thickness times its absorption "
                "coefficient."}}})},
        make_material<CoatedConductor>};
}

}  // namespace etendue
