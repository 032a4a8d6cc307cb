// OpenPBR surface without its volumes: a mixture of metal, glass and an opaque dielectric over a diffuse base, below a coat
// and fuzz. It conserves energy: with white colours it reflects and transmits all light, whatever its other parameters.
//   base_weight (1), base_color (0.8)   albedo of the diffuse base, and reflectance of metal at normal incidence
//   base_diffuse_roughness (0)          roughness of the diffuse base, in [0, 1]; a number
//   base_metalness (0)                  share of metal
//   specular_weight (1)                 factor of the dielectric's reflectance at normal incidence: another index replaces
//                                       specular_ior
//   specular_color (1)                  factor of the dielectric's reflection; of metal, that at 82°
//   specular_roughness (0.3)            square root of α; below 0.01 the surface is smooth
//   specular_roughness_anisotropy (0)   stretches highlights along ∂p/∂u; a number
//   specular_ior (1.5)                  index below over index above; a number
//   transmission_weight (0)             share of glass in what is not metal
//   transmission_color (1)              colour of light that passes two boundaries, each with its square root
//   coat_weight (0), coat_color (1), coat_roughness (0), coat_ior (1.6)      clear coat over all of these, and its
//                                       transmittance at normal incidence, down and up; numbers but for the weight
//   fuzz_weight (0), fuzz_color (1), fuzz_roughness (0.5)      fibres over all; numbers but for the weight
//   thin_walled (false)                 glass is a smooth pane without coat and fuzz; the surface is seen from both sides
// Names, mixture and roughness are those of [OpenPBR 2024]. What differs:
//   - Layers. OpenPBR multiplies what lies below a layer by 1 − E(o), E being the layer's albedo for the direction of view.
//     Here all is reciprocal, so that methods that trace light find the same image. A diffuse base below a dielectric has
//     ρ (1 − E(o)) (1 − E(i)) / (π (1 − Ē)) [Kelemen & Szirmay-Kalos 2001; Kulla & Conty 2017]. Below coat and fuzz all is
//     multiplied by min(1 − E(o), 1 − E(i)), and a lobe v(o) v(i) / (π v̄) returns what the minimum takes too much.
//   - Facets are GGX, with the lobes of [Kulla & Conty 2017] for light reflected several times: 1 − E(o) with the colour
//     F̄² Ē / (1 − F̄ (1 − Ē)). Those of glass are reflected and transmitted in shares that keep them adjoint.
//   - Metal has F82-tint [Kutz et al. 2021], the diffuse base f_FON with the multiple scattering of EON
//     [Portsmouth et al. 2025], fuzz the cloth of [Estevez & Kulla 2017].
//   - specular_weight does not scale the reflection of metal.
//   - The coat is isotropic and does not darken its base by reflections between them, and there is no subsurface scattering,
//     dispersion, thin film or emission.
// A thin-walled material, and one with transmission, has its opaque part on both sides; other ones reflect on the front alone.
// The albedo of white surfaces is 1 within 0.5 %, for roughnesses from 0 to 1; within 6° of the horizon it is 1 within 1.4 % where
// the roughness is a texture. Of surfaces with both coat and fuzz it is 0.985 to 1.006, since the fuzz is taken to lie on the
// slab alone.

#include "bsdf/openpbr.h"

#include "bsdf/material.h"
#include "bsdf/thindielectric.h"
#include "math/warp.h"

namespace etendue {
namespace {

/// Angle of F82-tint: cos 82° ≈ 1/7.
constexpr float kCos82 = 1 / 7.0f;

float pow5(float x) {
    return sqr(sqr(x)) * x;
}
Rgb schlick(Rgb F0, float cos) {
    return lerp(pow5(clamp(1 - cos, 0, 1)), F0, Rgb(1));
}
/// Factor of μ (1 − μ)⁶ by which F82-tint is below Schlick's approximation.
Rgb dip(Rgb F0, Rgb tint) {
    constexpr float kShape = kCos82 * (1 - kCos82) * (1 - kCos82) * (1 - kCos82) * (1 - kCos82) *
                             (1 - kCos82) * (1 - kCos82);
    return schlick(F0, kCos82) * (Rgb(1) - tint) / kShape;
}
Rgb at_least_zero(Rgb c) {
    return {std::fmax(c.r, 0.0f), std::fmax(c.g, 0.0f), std::fmax(c.b, 0.0f)};
}

}  // namespace

Rgb OpenPbrLobe::fresnel(float cos_m) const {
    if (slab != OpenPbrSlab::Metal) return tint * fresnel_dielectric(cos_m, eta).R;
    const float rest = 1 - cos_m;
    return at_least_zero(schlick(color, cos_m) - dip(color, tint) * (cos_m * pow5(rest) * rest));
}

/// 2 ∫ F μ dμ = F0 + (1 − F0)/21 − dip/126, and the series over the reflections.
Rgb OpenPbrLobe::interreflected(float lost) const {
    const Rgb F = at_least_zero(lerp(1 / 21.0f, color, Rgb(1)) - dip(color, tint) / 126.0f);
    return F * F * (1 - lost) / (Rgb(1) - F * lost);
}

Rgb OpenPbrLobe::excess_color() const {
    return slab == OpenPbrSlab::Glass ? tint : color;
}

OpenPbrLobe::End OpenPbrLobe::end(Vec3 w) const {
    End e;
    e.w = w;
    e.cos = std::fabs(w.z);
    e.row = table->row(alpha(), eta, w);
    e.place = CosineNodes::place(e.cos);
    const bool is_above = w.z > 0;
    // Smooth facets lose nothing, and the table of a textured roughness is interpolated towards rough ones.
    if (has_smooth_facets())
        e.base = slab == OpenPbrSlab::Opaque ? fresnel_dielectric(e.cos, eta).R : 0.0f;
    else
        e.base =
            table->at(is_above ? OpenPbrTable::kBase : OpenPbrTable::kBaseBelow, e.row, e.place);
    if (!is_covered()) return e;
    if (coat > 0) {
        if (is_above) e.coat = coat * table->layers().coat_albedo(e.cos);
        e.coat_excess =
            coat * table->at(is_above ? OpenPbrTable::kCoatExcess : OpenPbrTable::kCoatExcessBelow,
                             e.row, e.place);
    }
    if (fuzz > 0) {
        if (is_above) e.fuzz = fuzz * table->layers().fuzz_albedo(e.cos);
        e.fuzz_excess = fuzz_below_coat() * table->at(is_above ? OpenPbrTable::kFuzzExcess
                                                               : OpenPbrTable::kFuzzExcessBelow,
                                                      e.row, e.place);
    }
    const float cosine = e.fuzz + e.coat_excess + e.fuzz_excess,
                slab_share = (1 - e.fuzz) * (1 - e.coat), sum = cosine + e.coat + slab_share;
    e.p_cosine = cosine / sum;
    e.p_coat = e.coat / sum;
    e.p_slab = slab_share / sum;
    return e;
}

float OpenPbrLobe::facet_probability(const End& e, float interreflection) const {
    if (slab != OpenPbrSlab::Opaque) return 1 - e.base;
    const float top = tint.max(), facets = e.base * top,
                diffuse = (1 - e.base) * std::fmax(color.max(), interreflection * top);
    return facets > 0 ? facets / (facets + diffuse) : 0;
}

float OpenPbrLobe::facet_probability(const End& e) const {
    return facet_probability(e, slab == OpenPbrSlab::Opaque ? table->interreflection(mean_row())
                                                            : 0.0f);
}

BsdfEval OpenPbrLobe::eval_facets(const End& o, const End& i, float p_o, float p_i) const {
    const Vec3 h = o.w + i.w, m = h / length(h);
    if (!(m.z > 0)) return {};  // opposite grazing directions: not resolved by float
    const Microfacet distribution = facets();
    const float quarter_D = 0.25f * distribution.D(m), pdf = quarter_D / distribution.sigma(o.w),
                sigma_i = distribution.sigma(i.w);
    return {fresnel(dot(o.w, m)) * (pdf * i.cos / sigma_i), p_o * pdf, p_i * quarter_D / sigma_i};
}

BsdfEval OpenPbrLobe::eval_metal(const End& o, const End& i) const {
    if (has_smooth_facets()) return {};
    BsdfEval e = eval_facets(o, i, 1 - o.base, 1 - i.base);
    const float lost = table->mean(OpenPbrTable::kBase, mean_row());
    if (!(lost > 0)) return e;
    e.f += interreflected(lost) * (o.base * i.base / lost * i.cos * kInvPi);
    e.pdf += o.base * i.cos * kInvPi;
    e.pdf_rev += i.base * o.cos * kInvPi;
    return e;
}

BsdfEval OpenPbrLobe::eval_opaque(const End& o, const End& i) const {
    const OpenPbrTable::Row r = mean_row();
    const float again = table->interreflection(r), mean = table->mean(OpenPbrTable::kBase, r);
    const Rgb go = Rgb(1) - tint * o.base, gi = Rgb(1) - tint * i.base,
              separable = go * gi / (Rgb(1 + 1e-6f) - tint * mean);
    Rgb base = separable * base_of_opaque(again);
    if (const float roughness = table->layers().constants().diffuse_roughness; roughness > 0) {
        // min(g(o), g(i)) f_FON, and what these leave, coloured as in EON.
        const float once = fon(roughness, o.cos, i.cos, o.w.x * i.w.x + o.w.y * i.w.y);
        const auto left = [&](float lost, float excess) {
            return at_least_zero(Rgb(lost) + tint * excess);
        };
        const Rgb lo = left(table->lost_by_diffuse(o.place),
                            table->at(OpenPbrTable::kRoughDiffuse, o.row, o.place)),
                  li = left(table->lost_by_diffuse(i.place),
                            table->at(OpenPbrTable::kRoughDiffuse, i.row, i.place)),
                  l = left(table->mean_lost_by_diffuse(),
                           table->mean(OpenPbrTable::kRoughDiffuse, r));
        const Rgb least = Rgb(1) - tint * std::fmax(o.base, i.base);
        const float lost = table->mean_lost_by_diffuse();
        const Rgb several = color * color * (1 - lost) / (Rgb(1) - color * lost);
        base = lerp(again, color * least * once + several * lo * li / (l + Rgb(1e-6f)),
                    separable * tint);
    }
    const float p_o = facet_probability(o, again), p_i = facet_probability(i, again);
    BsdfEval e;
    if (has_facets() && !has_smooth_facets()) e = eval_facets(o, i, p_o, p_i);
    e.f += base * (i.cos * kInvPi);
    e.pdf += (1 - p_o) * i.cos * kInvPi;
    e.pdf_rev += (1 - p_i) * o.cos * kInvPi;
    return e;
}

/// `single`: value and densities of light scattered once.
BsdfEval OpenPbrLobe::eval_glass(const End& o, const End& i, const BsdfEval& single) const {
    const bool is_above = o.w.z > 0, transmits = o.w.z * i.w.z < 0;
    BsdfEval e = single;
    e.pdf *= 1 - o.base;
    e.pdf_rev *= 1 - i.base;
    if (transmits) e.eta = is_above ? eta : 1 / eta;
    const float mean =
        table->mean(i.w.z > 0 ? OpenPbrTable::kBase : OpenPbrTable::kBaseBelow, mean_row());
    if (!(mean > 0)) return e;
    const GlassShares s = table->shares(mean_row(), eta);
    const auto share = [&](bool above) {
        const float t = above ? s.above : s.below;
        return transmits ? t : 1 - t;
    };
    const float share_o = share(is_above), share_i = share(i.w.z > 0);
    // Each further facet tints the light with the mean of the two colours.
    const Rgb tinted = 0.5f * (color + tint);
    const float lost = 0.5f * (table->mean(OpenPbrTable::kBase, mean_row()) +
                               table->mean(OpenPbrTable::kBaseBelow, mean_row()));
    const Rgb several = tinted * (1 - lost) / (Rgb(1) - tinted * lost);
    e.f +=
        (transmits ? color : tint) * several * (share_o * o.base * i.base / mean * i.cos * kInvPi);
    e.pdf += o.base * share_o * i.cos * kInvPi;
    e.pdf_rev += i.base * share_i * o.cos * kInvPi;
    return e;
}

BsdfEval OpenPbrLobe::eval_slab(const End& o, const End& i) const {
    switch (slab) {
    case OpenPbrSlab::Metal: return eval_metal(o, i);
    case OpenPbrSlab::Opaque: return eval_opaque(o, i);
    case OpenPbrSlab::Glass:
        return eval_glass(o, i, has_smooth_facets() ? BsdfEval{} : glass().eval(o.w, i.w));
    }
    return {};
}

Rgb OpenPbrLobe::passed(const End& o, const End& i) const {
    const bool transmits = o.w.z * i.w.z < 0;
    if (!transmits && o.w.z < 0) return Rgb(1);
    const End& above = o.w.z > 0 ? o : i;
    const End& other = transmits ? above : i;
    const float fuzz_o = std::fmax(above.fuzz, other.fuzz),
                coat_o = std::fmax(above.coat, other.coat);
    const Rgb T((1 - fuzz_o) * (1 - coat_o));
    const OpenPbrConstants& c = table->layers().constants();
    if (!(coat > 0) || c.coat_color == Rgb(1)) return T;
    // The colour is that for the way down and up along the normal.
    const float below_o = cos_below_coat(above.cos, c.coat_eta),
                below_i = cos_below_coat(other.cos, c.coat_eta);
    const float ways = transmits ? 0.5f / below_o : 0.5f / below_o + 0.5f / below_i;
    const auto absorbed = [&](float t) { return lerp(coat, 1, t > 0 ? std::pow(t, ways) : 0.0f); };
    return T * Rgb(absorbed(c.coat_color.r), absorbed(c.coat_color.g), absorbed(c.coat_color.b));
}

BsdfEval OpenPbrLobe::covered(const BsdfEval& slab_value, const End& o, const End& i) const {
    BsdfEval e = slab_value;
    e.f *= passed(o, i);
    e.pdf *= o.p_slab;
    e.pdf_rev *= i.p_slab;
    if (o.w.z * i.w.z < 0) return e;
    const bool is_above = o.w.z > 0;
    const OpenPbrLayers& layers = table->layers();
    const OpenPbrTable::Row r = mean_row();
    const float below_fuzz = 1 - std::fmax(o.fuzz, i.fuzz);
    e.pdf += o.p_cosine * i.cos * kInvPi;
    e.pdf_rev += i.p_cosine * o.cos * kInvPi;
    const auto returned = [&](float vo, float vi, float weight, OpenPbrTable::Plane plane) {
        const float mean = weight * table->mean(plane, r);
        return mean > 0 ? vo * vi / mean : 0;
    };
    const float coat_returns =
                    returned(o.coat_excess, i.coat_excess, coat,
                             is_above ? OpenPbrTable::kCoatExcess : OpenPbrTable::kCoatExcessBelow),
                fuzz_returns =
                    returned(o.fuzz_excess, i.fuzz_excess, fuzz_below_coat(),
                             is_above ? OpenPbrTable::kFuzzExcess : OpenPbrTable::kFuzzExcessBelow);
    e.f += excess_color() *
           (Rgb(fuzz_returns) +
            lerp(coat, Rgb(1), layers.constants().coat_color) * (below_fuzz * coat_returns)) *
           (i.cos * kInvPi);
    if (!is_above) return e;
    const Vec3 h = o.w + i.w, m = h / length(h);
    if (!(m.z > 0)) return e;
    if (fuzz > 0) e.f += layers.constants().fuzz_color * (fuzz * layers.fuzz(o.w, i.w, m) * i.cos);
    if (coat > 0 && !layers.has_smooth_coat()) {
        const Microfacet distribution = layers.coat();
        const float quarter_D = 0.25f * distribution.D(m), sigma_o = distribution.sigma(o.w),
                    sigma_i = distribution.sigma(i.w);
        const float F = fresnel_dielectric(dot(o.w, m), layers.constants().coat_eta).R;
        e.f += Rgb(below_fuzz * coat * F * quarter_D * i.cos / (sigma_o * sigma_i));
        e.pdf += o.p_coat * quarter_D / sigma_o;
        e.pdf_rev += i.p_coat * quarter_D / sigma_i;
    }
    return e;
}

BsdfEval OpenPbrLobe::eval(const End& o, Vec3 wi) const {
    const End i = end(wi);
    const BsdfEval e = eval_slab(o, i);
    return is_covered() ? covered(e, o, i) : e;
}

BsdfEval OpenPbrLobe::eval(Vec3 wo, Vec3 wi) const {
    if (slab == OpenPbrSlab::Glass ? wo.z == 0 || wi.z == 0 : !(wo.z > 0 && wi.z > 0)) return {};
    return eval(end(wo), wi);
}

std::optional<BsdfSample> OpenPbrLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (slab == OpenPbrSlab::Glass ? wo.z == 0 : !(wo.z > 0)) return {};
    const End o = end(wo);
    const float side = std::copysign(1.0f, wo.z);
    const auto to = [&](Vec3 wi) -> std::optional<BsdfSample> {
        if (!(wi.z * side > 0)) return {};
        return make_sample(wi, eval(o, wi));
    };
    if (u_lobe < o.p_cosine) return to(sample_cosine_hemisphere(u) * side);
    u_lobe -= o.p_cosine;
    if (u_lobe < o.p_coat) {
        if (table->layers().has_smooth_coat()) return delta_event(wo, false);
        return to(normalize(reflect(wo, table->layers().coat().sample_visible(wo, u))));
    }
    u_lobe = std::fmin((u_lobe - o.p_coat) / o.p_slab, kOneMinusEpsilon);
    const float p = facet_probability(o);
    if (slab != OpenPbrSlab::Glass) {
        if (u_lobe >= p) return to(sample_cosine_hemisphere(u));
        if (has_smooth_facets()) return delta_event(wo, false);
        return to(normalize(reflect(wo, facets().sample_visible(wo, u))));
    }
    if (u_lobe >= p) {
        u_lobe = (u_lobe - p) / (1 - p);
        const GlassShares s = table->shares(mean_row(), eta);
        const bool transmits = u_lobe < (side > 0 ? s.above : s.below);
        const Vec3 wi = sample_cosine_hemisphere(u) * (transmits ? -side : side);
        if (wi.z == 0) return {};
        return make_sample(wi, eval(o, wi));
    }
    u_lobe = std::fmin(u_lobe / p, kOneMinusEpsilon);
    if (has_smooth_facets()) return delta_event(wo, !(u_lobe < fresnel_dielectric(wo.z, eta).R));
    const std::optional<BsdfSample> single = glass().sample(wo, u_lobe, u);
    if (!single) return {};
    const End i = end(single->wi);
    BsdfEval e =
        eval_glass(o, i, {single->weight * single->pdf, single->pdf, single->pdf_rev, single->eta});
    if (is_covered()) e = covered(e, o, i);
    return make_sample(single->wi, e);
}

std::optional<BsdfSample> OpenPbrLobe::delta_event(Vec3 wo, bool transmits) const {
    if (slab == OpenPbrSlab::Glass ? wo.z == 0 : !(wo.z > 0)) return {};
    if (!has_delta() || (transmits && slab != OpenPbrSlab::Glass)) return {};
    const End o = end(wo);
    const DielectricFresnel F = fresnel_dielectric(wo.z, eta);
    if (transmits) {
        const float T = 1 - F.R;
        if (!(has_smooth_facets() && T > 0)) return {};
        const Vec3 wi = normalize(refract(wo, F));
        const End i = end(wi);
        if (!(o.p_slab > 0)) return {};
        return BsdfSample{.wi = wi,
                          .weight = color * passed(o, i) / o.p_slab,
                          .pdf = T * o.p_slab,
                          .pdf_rev = T * i.p_slab,
                          .eta = F.eta,
                          .is_delta = true};
    }
    Rgb f;
    float p = 0;
    if (has_smooth_facets() && has_facets()) {
        f = fresnel(slab == OpenPbrSlab::Glass ? wo.z : o.cos) * passed(o, o);
        p = o.p_slab * (slab == OpenPbrSlab::Glass ? F.R : facet_probability(o));
    }
    if (has_smooth_coat() && wo.z > 0) {
        // e.coat is the albedo of a smooth coat, F, times its weight.
        f += Rgb((1 - o.fuzz) * o.coat);
        p += o.p_coat;
    }
    if (!(p > 0)) return {};
    return BsdfSample{.wi = reflect(wo), .weight = f / p, .pdf = p, .pdf_rev = p, .is_delta = true};
}

float OpenPbrLobe::max_pdf(Vec3 wo, const DirectionCone& c) const {
    if (slab == OpenPbrSlab::Glass ? wo.z == 0 : !(wo.z > 0)) return 0;
    const End o = end(wo);
    const Vec3 own{0, 0, std::copysign(1.0f, wo.z)};
    const float cosine = std::fmax(c.max_cos(own), 0.0f) * kInvPi, p = facet_probability(o);
    float bound = o.p_cosine * cosine;
    if (o.p_coat > 0 && !table->layers().has_smooth_coat())
        bound += o.p_coat * table->layers().coat().max_pdf_of_reflection(wo, c);
    if (slab == OpenPbrSlab::Glass) {
        const float both = std::fmax(std::fmax(c.max_cos(own), c.max_cos(-own)), 0.0f) * kInvPi;
        const float once = has_smooth_facets() ? 0.0f : p * glass().max_pdf(wo, c);
        return bound + o.p_slab * (once + (1 - p) * both);
    }
    const float once =
        has_smooth_facets() || !has_facets() ? 0.0f : p * facets().max_pdf_of_reflection(wo, c);
    return bound + o.p_slab * (once + (1 - p) * cosine);
}

Rgb OpenPbrLobe::albedo_estimate() const {
    if (slab == OpenPbrSlab::Metal) return color;
    const float F = fresnel_dielectric(1, eta).R;
    return tint * F + color * (1 - F);
}

float OpenPbrLobe::roughness() const {
    float sharpest = 1;
    if (has_facets() && !has_smooth_facets()) sharpest = std::fmin(sharpest, facets().min_alpha());
    if (coat > 0 && !table->layers().has_smooth_coat())
        sharpest = std::fmin(sharpest, table->layers().coat().min_alpha());
    return sharpest;
}

namespace {

class OpenPbr final : public Material {
public:
    OpenPbr(const Params& params, MaterialContext& context)
        : base_weight_(context.texture(params, "base_weight", Rgb(1), 1)),
          base_color_(context.texture(params, "base_color", Rgb(0.8f), 1)),
          metalness_(context.texture(params, "base_metalness", Rgb(0), 1)),
          specular_weight_(context.texture(params, "specular_weight", Rgb(1))),
          specular_color_(context.texture(params, "specular_color", Rgb(1))),
          roughness_(context.texture(params, "specular_roughness", Rgb(0.3f), 1)),
          transmission_(context.texture(params, "transmission_weight", Rgb(0), 1)),
          transmission_color_(context.texture(params, "transmission_color", Rgb(1), 1)),
          coat_(context.texture(params, "coat_weight", Rgb(0), 1)),
          fuzz_(context.texture(params, "fuzz_weight", Rgb(0), 1)),
          ior_(params.number("specular_ior", 1.5f, 0.01f, 1e6f)),
          coat_roughness_(params.number("coat_roughness", 0, 0, 1)),
          is_thin_(params.flag("thin_walled", false)) {
        OpenPbrConstants& c = constants_;
        const Surface at = surface(TexturePoint());
        c.diffuse_roughness = params.number("base_diffuse_roughness", 0, 0, 1);
        c.eta_varies = !specular_weight_.is_constant() || !specular_color_.is_constant();
        c.eta = c.eta_varies ? (ior_ < 1 ? 0.5f : 2.0f) : at.eta;
        c.alpha_varies = !roughness_.is_constant() || (coat_roughness_ > 0 && !coat_.is_constant());
        c.alpha = c.alpha_varies ? 0 : at.alpha;
        c.aspect = 1 - params.number("specular_roughness_anisotropy", 0, 0, 1);
        if (c.alpha == 0 && !c.alpha_varies) c.aspect = 1;
        c.has_coat = may_be(coat_);
        c.has_fuzz = may_be(fuzz_);
        if (c.has_coat) {
            c.coat_alpha = sqr(coat_roughness_);
            c.coat_eta = params.number("coat_ior", 1.6f, 1, 100);
            c.coat_color = params.rgb("coat_color", Rgb(1));
            if (c.coat_color.max() > 1)
                params.fail("coat_color", "the transmittance must not exceed 1");
        }
        if (c.has_fuzz) {
            c.fuzz_roughness = params.number("fuzz_roughness", 0.5f, 0, 1);
            c.fuzz_color = params.rgb("fuzz_color", Rgb(1));
            if (c.fuzz_color.max() > 1)
                params.fail("fuzz_color", "the reflectance must not exceed 1");
        }
        for (const OpenPbrSlab s : {OpenPbrSlab::Metal, OpenPbrSlab::Opaque, OpenPbrSlab::Glass}) {
            OpenPbrConstants own = c;
            if (s == OpenPbrSlab::Glass && !c.eta_varies) own.eta = glass_eta(c.eta);
            if (s == OpenPbrSlab::Metal) own.eta = 1.5f, own.eta_varies = false;
            if (s != OpenPbrSlab::Opaque) own.diffuse_roughness = 0;
            tables_[size_t(s)] = SharedOpenPbrTable::of(s, own);
        }
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        const TexturePoint at = point.texture_point();
        const float metal = metalness_.eval_scalar(at),
                    transmitting = transmission_.eval_scalar(at),
                    glass = (1 - metal) * transmitting, opaque = (1 - metal) * (1 - transmitting);
        const Surface s = surface(at);
        const Vec2 alphas = constants_.alphas(s.alpha);
        const Rgb base = base_color_.eval(at) * base_weight_.eval_scalar(at);
        OpenPbrLobe lobe{.color = base,
                         .tint = s.tint,
                         .alpha_x = alphas.x,
                         .alpha_y = alphas.y,
                         .eta = s.eta,
                         .coat = s.coat,
                         .fuzz = fuzz_.eval_scalar(at),
                         .slab = OpenPbrSlab::Opaque,
                         .table = nullptr};
        const Frame reflecting =
            is_two_sided() && !sees_front(point, frame) ? frame.flipped() : frame;
        const auto add = [&](const Frame& f, OpenPbrSlab slab, float share) {
            if (!(share > 0)) return;
            lobe.slab = slab;
            lobe.table = &tables_[size_t(slab)]->get();
            list.add(f, lobe, weight * share);
        };
        add(reflecting, OpenPbrSlab::Opaque, opaque);
        add(reflecting, OpenPbrSlab::Metal, metal);
        lobe.eta = glass_eta(s.eta);
        const Rgb transmitted = transmission_color_.eval(at);
        lobe.color = sqrt(transmitted);
        if (is_thin_ && glass > 0)
            list.add(frame, ThinDielectricLobe{lobe.eta, lobe.tint, transmitted}, weight * glass);
        else
            add(frame, OpenPbrSlab::Glass, glass);
    }
    bool is_transmissive() const override { return may_be(transmission_); }
    bool is_two_sided() const override { return is_transmissive() || is_thin_; }
    bool may_be_smooth() const override {
        return !roughness_.is_constant() ||
               sqr(roughness_.eval_scalar(Vec2())) > Microfacet::kMinAlpha || may_be(coat_) ||
               may_be(fuzz_) || !(is_one(metalness_) || is_one(transmission_));
    }
    bool may_have_delta() const override {
        return constants_.alpha_varies || constants_.alpha <= Microfacet::kMinAlpha ||
               may_be(coat_) || (is_thin_ && may_be(transmission_));
    }
    Rgb mean_albedo() const override {
        const float metal = metalness_.mean().mean(),
                    glass = (1 - metal) * transmission_.mean().mean();
        return base_color_.mean() * (base_weight_.mean().mean() * (1 - glass)) +
               transmission_color_.mean() * glass;
    }

private:
    static bool may_be(const TextureRef& t) {
        return !t.is_constant() || t.eval_scalar(Vec2()) > 0;
    }
    static bool is_one(const TextureRef& t) {
        return t.is_constant() && t.eval_scalar(Vec2()) == 1;
    }
    static constexpr float kLargestR0 = 0.999f;
    /// Replaces η = 1, where refraction would have no facets.
    static constexpr float kEtaOfClearGlass = 1.001f;
    static float glass_eta(float eta) {
        if (eta < 1) return std::min(eta, 1 / kEtaOfClearGlass);
        return std::max(eta, kEtaOfClearGlass);
    }

    struct Surface {
        Rgb tint;
        float eta, alpha, coat;
    };
    /// What the specular parameters mean.
    Surface surface(const TexturePoint& at) const {
        Surface s;
        // Colours above 1 are weight.
        const Rgb color = specular_color_.eval(at);
        const float most = std::max(color.max(), 1.0f);
        s.tint = color / most;
        const float factor = specular_weight_.eval_scalar(at) * most;
        const float root =
            std::sqrt(std::min(sqr((ior_ - 1) / (ior_ + 1)) * std::max(factor, 0.0f), kLargestR0));
        s.eta = factor == 1 ? ior_ : ior_ < 1 ? (1 - root) / (1 + root) : (1 + root) / (1 - root);
        s.coat = coat_.eval_scalar(at);
        // The coat blurs what lies below.
        float r = roughness_.eval_scalar(at);
        if (s.coat > 0 && coat_roughness_ > 0) {
            const float below = sqr(sqr(r)) + 2 * sqr(sqr(coat_roughness_));
            r = lerp(s.coat, r, std::pow(std::min(1.0f, below), 0.25f));
        }
        s.alpha = sqr(r);
        return s;
    }

    TextureRef base_weight_, base_color_, metalness_, specular_weight_, specular_color_, roughness_,
        transmission_, transmission_color_, coat_, fuzz_;
    float ior_, coat_roughness_;
    bool is_thin_;
    OpenPbrConstants constants_;
    std::array<std::shared_ptr<const SharedOpenPbrTable>, 3> tables_;
};

}  // namespace

MaterialEntry openpbr_entry() {
    return {
        {"bsdf",
         "openpbr",
         "OpenPBR surface: metal, glass or a dielectric over a diffuse base, below coat and fuzz; "
         "conserves energy.",
         {{"base_weight", ParamKind::Texture, "1", "Factor of the base colour, in [0, 1]."},
          {"base_color", ParamKind::Texture, "0.8",
           "Albedo of the diffuse base and reflectance of metal, in [0, 1]."},
          {"base_diffuse_roughness", ParamKind::Float, "0",
           "Roughness of the diffuse base, in [0, 1]."},
          {"base_metalness", ParamKind::Texture, "0", "Fraction of metal, in [0, 1]."},
          {"specular_weight", ParamKind::Texture, "1",
           "Factor of the reflectance at normal incidence of what is not metal."},
          {"specular_color", ParamKind::Texture, "1",
           "Factor of the reflection of what is not metal; of metal, that at 82 degrees."},
          {"specular_roughness", ParamKind::Texture, "0.3",
           "Square root of the facets' alpha, in [0, 1]."},
          {"specular_roughness_anisotropy", ParamKind::Float, "0",
           "Stretches highlights along the u direction, in [0, 1]."},
          {"specular_ior", ParamKind::Float, "1.5",
           "Index of refraction below the surface divided by that above it."},
          {"transmission_weight", ParamKind::Texture, "0",
           "Fraction of glass in the part that is not metal, in [0, 1]."},
          {"transmission_color", ParamKind::Texture, "1",
           "Colour of light that has passed two surfaces, in [0, 1]."},
          {"coat_weight", ParamKind::Texture, "0", "Strength of the clear coat, in [0, 1]."},
          {"coat_color", ParamKind::Rgb, "1",
           "Transmittance of the coat along the normal, down and up, in [0, 1]."},
          {"coat_roughness", ParamKind::Float, "0", "Roughness of the coat, in [0, 1]."},
          {"coat_ior", ParamKind::Float, "1.6", "Index of refraction of the coat, at least 1."},
          {"fuzz_weight", ParamKind::Texture, "0", "Strength of the fuzz, in [0, 1]."},
          {"fuzz_color", ParamKind::Rgb, "1", "Albedo of the fuzz, in [0, 1]."},
          {"fuzz_roughness", ParamKind::Float, "0.5",
           "Roughness of the fuzz, in [0, 1]: lower values brighten the edges."},
          {"thin_walled", ParamKind::Bool, "false",
           "Whether the surface is thin: seen from both sides, with the transmission of a clear "
           "pane without roughness, "
           "coat and fuzz."}}},
        make_material<OpenPbr>};
}

}  // namespace etendue
