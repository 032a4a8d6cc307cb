// OpenPBR surface without its volumes: a mixture of metal, glass and an opaque dielectric over a diffuse base, below a coat
// and fuzz. It conserves energy: with white colours it reflects and transmits all light, whatever its other parameters.
//   base_weight (1), base_color (0.8)   albedo of the diffuse base, and reflectance of metal at normal incidence
//   base_diffuse_roughness (0)          roughness of the diffuse base, in [0, 1]
//   base_metalness (0)                  share of metal
//   specular_weight (1)                 factor of the dielectric's reflectance at normal incidence: another index replaces
//                                       specular_ior
//   specular_color (1)                  factor of the dielectric's reflection; of metal, that at 82°
//   specular_roughness (0.3)            square root of α; below 0.01 the surface is smooth
//   specular_roughness_anisotropy (0)   stretches highlights along ∂p/∂u, or ∂p/∂v where it is negative; a number
//   specular_ior (1.5)                  index below over index above; a number
//   transmission_weight (0)             share of glass in what is not metal
//   transmission_color (1)              colour of light that passes two boundaries, each with its square root
//   coat_weight (0), coat_color (1), coat_roughness (0), coat_ior (1.6)      clear coat over all of these, and its
//                                       transmittance at normal incidence, down and up; the index is a number
//   coat_affect_ior (1)                 1: the index below the coat is relative to the coat's; 0: to that above; a number
//   coat_affect_roughness (1)           1: the coat's roughness blurs what lies below; 0: it does not; a number
//   fuzz_weight (0), fuzz_color (1), fuzz_roughness (0.5)      fibres over all
//   thin_walled (false)                 glass is a smooth pane without coat and fuzz; the surface is seen from both sides
// All of them may be textures, except those that are said to be numbers.
// Names, mixture and roughness are those of [OpenPBR 2024]. What differs:
//   - Layers. OpenPBR multiplies what lies below a layer by 1 − E(o), E being the layer's albedo for the direction of view.
//     Here all is reciprocal, so that methods that trace light find the same image. A diffuse base below a dielectric has
//     ρ (1 − E(o)) (1 − E(i)) / (π (1 − Ē)) [Kelemen & Szirmay-Kalos 2001; Kulla & Conty 2017]. Below a layer all is
//     multiplied by min(1 − E(o), 1 − E(i)): the slab by the factors of coat and fuzz, the coat by that of the fuzz. What
//     the minima take too much, v(o) of white light, returns in a lobe v(o) v(i) / (π v̄). With the weights w_c and w_f of
//     coat and fuzz, v is w_c x + w_f y + w_c w_f z, of functions in tables.
//   - Facets are GGX, with the lobes of [Kulla & Conty 2017] for light reflected several times: 1 − E(o) with the colour
//     F̄² Ē / (1 − F̄ (1 − Ē)). Those of glass are reflected and transmitted in shares that keep them adjoint.
//   - Metal has F82-tint [Kutz et al. 2021], the diffuse base f_FON with the multiple scattering of EON
//     [Portsmouth et al. 2025], fuzz the cloth of [Estevez & Kulla 2017].
//   - specular_weight does not scale the reflection of metal.
//   - Glass keeps its index below a coat: light that has passed both boundaries is refracted as without the coat. An index
//     below 1 stays below 1.
//   - The coat is isotropic and does not darken its base by reflections between them, and there is no subsurface scattering,
//     dispersion, thin film or emission.
// A thin-walled material, and one with transmission, has its opaque part on both sides; other ones reflect on the front alone.
// The albedo of white surfaces is 1 within 0.5 %, for roughnesses from 0 to 1 and anisotropies up to 0.95, within 0.3 % with
// coat and fuzz together, and within 1 % where the roughness of coat or fuzz is a texture. Within 6° of the horizon it is 1
// within 1.4 % where the roughness of the facets is a texture.

#include "bsdf/openpbr.h"

#include <algorithm>
#include <initializer_list>

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
    if (tint == Rgb(1)) return Rgb(0);
    constexpr float kShape = kCos82 * (1 - kCos82) * (1 - kCos82) * (1 - kCos82) * (1 - kCos82) *
                             (1 - kCos82) * (1 - kCos82);
    return schlick(F0, kCos82) * (Rgb(1) - tint) / kShape;
}
Vec3 half_vector(Vec3 a, Vec3 b) {
    const Vec3 h = a + b;
    return h * (1 / length(h));
}
Rgb at_least_zero(Rgb c) {
    return {c.r > 0 ? c.r : 0.0f, c.g > 0 ? c.g : 0.0f, c.b > 0 ? c.b : 0.0f};
}

}  // namespace

OpenPbrLobe::Fixed::Fixed(const OpenPbrLobe& lobe)
    : Fixed(lobe, sqr(float(lobe.surface_roughness))) {}

OpenPbrLobe::Fixed::Fixed(const OpenPbrLobe& lobe, float alpha)
    : table(*lobe.table), row(table.mean_row(alpha, lobe.eta)), facets(lobe.facets_of(alpha)),
      is_glass(lobe.is_glass()), is_smooth(facets_are_smooth(facets)), tint(lobe.tint),
      is_white(tint == Rgb(1)), most_tint(tint.max()), most_color(lobe.color.max()),
      metal(is_glass ? 0.0f : float(lobe.metal)) {
    has_facets = is_glass || metal > 0 || lobe.eta != 1;
    if (!is_glass && metal < 1) interreflection = table.interreflection(row);
    coat = lobe.coat, fuzz = lobe.fuzz;
    is_covered = coat > 0 || fuzz > 0;
    if (!is_covered) return;
    const OpenPbrLayers& l = table.layers();
    if (coat > 0) {
        coat_alpha = sqr(float(lobe.coat_roughness));
        coat_color = lobe.coat_color;
        has_smooth_coat = OpenPbrLayers::is_smooth(coat_alpha);
        has_rough_coat = !has_smooth_coat;
    }
    if (l.has_rows()) layers = l.row(lobe.coat_roughness, lobe.fuzz_roughness);
}

template <class Sum>
float OpenPbrLobe::Fixed::taken(bool is_above, const Sum& sum) const {
    const Vec3 weights{coat, fuzz, coat * fuzz};
    if (is_glass) return sum(is_above ? OpenPbrTable::kAbove : OpenPbrTable::kBelow, weights);
    if (metal == 0) return sum(OpenPbrTable::kDielectric, weights);
    const float of_metal = sum(OpenPbrTable::kMetal, weights);
    return metal == 1 ? of_metal : lerp(metal, sum(OpenPbrTable::kDielectric, weights), of_metal);
}

Rgb OpenPbrLobe::fresnel(const Fixed& fixed, float cos_m) const {
    Rgb F;
    if (fixed.metal < 1) F = fixed.tint * (fresnel_dielectric(cos_m, eta).R * (1 - fixed.metal));
    if (fixed.metal > 0) {
        const float rest = 1 - cos_m;
        Rgb metal_F = schlick(color, cos_m);
        if (!fixed.is_white)
            metal_F = at_least_zero(metal_F - dip(color, fixed.tint) * (cos_m * pow5(rest) * rest));
        F += metal_F * fixed.metal;
    }
    return F;
}

/// 2 ∫ F μ dμ = F0 + (1 − F0)/21 − dip/126, and the series over the reflections.
Rgb OpenPbrLobe::interreflected(const Fixed& fixed, float lost) const {
    const Rgb F = at_least_zero(lerp(1 / 21.0f, color, Rgb(1)) - dip(color, fixed.tint) / 126.0f);
    return F * F * (1 - lost) / (Rgb(1) - F * lost);
}

OpenPbrLobe::End OpenPbrLobe::end(const Fixed& fixed, Vec3 w) const {
    const OpenPbrTable& t = fixed.table;
    End e;
    e.w = w;
    e.cos = std::fabs(w.z);
    e.row = t.row(fixed.row, w);
    e.place = CosineNodes::place(e.cos);
    const bool is_above = w.z > 0;
    // Smooth facets lose nothing, and the table of a textured roughness is interpolated towards rough ones.
    if (!fixed.is_smooth) {
        if (fixed.is_glass)
            e.lost =
                t.at(is_above ? OpenPbrTable::kLost : OpenPbrTable::kLostBelow, e.row, e.place);
        else if (fixed.metal > 0)
            e.lost = t.at(OpenPbrTable::kLost, e.row, e.place);
        if (fixed.metal < 1 && !fixed.is_glass)
            e.facets = t.at(OpenPbrTable::kFacets, e.row, e.place);
    } else if (fixed.metal < 1) {
        e.facets = fresnel_dielectric(e.cos, eta).R;
    }
    e.p_facets = facet_probability(fixed, e);
    if (!fixed.is_covered) return e;
    if (is_above) {
        const OpenPbrLayers& layers = t.layers();
        // The table of a textured roughness is interpolated towards rough coats.
        if (fixed.coat > 0)
            e.coat = fixed.coat * (fixed.has_smooth_coat && layers.constants().coat_roughness_varies
                                       ? fresnel_dielectric(e.cos, layers.constants().coat_eta).R
                                       : layers.coat_albedo(fixed.layers, e.place));
        if (fixed.fuzz > 0) e.fuzz = fixed.fuzz * layers.fuzz_albedo(fixed.layers, e.place);
    }
    e.excess = std::max(0.0f, fixed.taken(is_above, [&](OpenPbrTable::Side side, Vec3 weights) {
        return t.taken(side, e.row, fixed.layers, e.place, weights);
    }));
    const float cosine = e.fuzz + e.excess, slab_share = (1 - e.fuzz) * (1 - e.coat),
                scale = 1 / (cosine + e.coat + slab_share);
    e.p_cosine = cosine * scale;
    e.p_coat = e.coat * scale;
    e.p_slab = slab_share * scale;
    return e;
}

float OpenPbrLobe::facet_probability(const Fixed& fixed, const End& e) const {
    if (fixed.is_glass || fixed.metal == 1) return 1 - e.lost;
    const float facets = e.facets * fixed.most_tint,
                diffuse = (1 - e.facets) *
                          std::max(fixed.most_color, fixed.interreflection * fixed.most_tint);
    const float p = facets > 0 ? facets / (facets + diffuse) : 0;
    return fixed.metal > 0 ? lerp(fixed.metal, p, 1 - e.lost) : p;
}

BsdfEval OpenPbrLobe::eval_facets(const Fixed& fixed, const End& o, const End& i, Vec3 m) const {
    if (!(m.z > 0)) return {};  // opposite grazing directions: not resolved by float
    const float quarter_D = 0.25f * fixed.facets.D(m), pdf = quarter_D / fixed.facets.sigma(o.w),
                over_sigma_i = 1 / fixed.facets.sigma(i.w);
    return {fresnel(fixed, dot(o.w, m)) * (pdf * i.cos * over_sigma_i), o.p_facets * pdf,
            i.p_facets * quarter_D * over_sigma_i};
}

Rgb OpenPbrLobe::diffuse_base(const Fixed& fixed, const End& o, const End& i) const {
    const OpenPbrTable& t = fixed.table;
    const Rgb tint = fixed.tint;
    const float mean = t.mean(OpenPbrTable::kFacets, fixed.row);
    const Rgb separable = fixed.is_white ? Rgb((1 - o.facets) * (1 - i.facets) / (1 + 1e-6f - mean))
                                         : (Rgb(1) - tint * o.facets) * (Rgb(1) - tint * i.facets) /
                                               (Rgb(1 + 1e-6f) - tint * mean);
    const float again = fixed.interreflection, roughness = diffuse_roughness;
    if (!(roughness > 0)) return separable * lerp(again, color, tint);
    // min(g(o), g(i)) f_FON, and what these leave, coloured as in EON.
    const Fon fon(roughness);
    const float once = fon.eval(o.cos, i.cos, o.w.x * i.w.x + o.w.y * i.w.y);
    const auto left = [&](float bent, float larger, float larger_bent, float E) {
        return at_least_zero(Rgb(1 - fon.of(1, bent)) + tint * (fon.of(larger, larger_bent) - E));
    };
    const auto left_at = [&](const End& e) {
        return left(t.bent(e.place), t.at(OpenPbrTable::kLarger, e.row, e.place),
                    t.at(OpenPbrTable::kLargerBent, e.row, e.place), e.facets);
    };
    const Rgb l = left(t.mean_bent(), t.mean(OpenPbrTable::kLarger, fixed.row),
                       t.mean(OpenPbrTable::kLargerBent, fixed.row), mean);
    const Rgb least = Rgb(1) - tint * std::max(o.facets, i.facets);
    const float lost = 1 - fon.of(1, t.mean_bent());
    const Rgb several = color * color * (1 - lost) / (Rgb(1) - color * lost);
    return lerp(again, color * least * once + several * left_at(o) * left_at(i) / (l + Rgb(1e-6f)),
                separable * tint);
}

BsdfEval OpenPbrLobe::eval_opaque(const Fixed& fixed, const End& o, const End& i, Vec3 m) const {
    BsdfEval e;
    if (fixed.has_facets && !fixed.is_smooth) e = eval_facets(fixed, o, i, m);
    Rgb wide;
    if (fixed.metal < 1) wide = diffuse_base(fixed, o, i) * (1 - fixed.metal);
    if (fixed.metal > 0 && o.lost * i.lost > 0)
        if (const float lost = fixed.table.mean(OpenPbrTable::kLost, fixed.row); lost > 0)
            wide += interreflected(fixed, lost) * (fixed.metal * o.lost * i.lost / lost);
    e.f += wide * (i.cos * kInvPi);
    e.pdf += (1 - o.p_facets) * i.cos * kInvPi;
    e.pdf_rev += (1 - i.p_facets) * o.cos * kInvPi;
    return e;
}

/// `single`: value and densities of light scattered once.
BsdfEval OpenPbrLobe::eval_glass(const Fixed& fixed, const End& o, const End& i,
                                 const BsdfEval& single) const {
    const OpenPbrTable& t = fixed.table;
    const bool is_above = o.w.z > 0, transmits = o.w.z * i.w.z < 0;
    BsdfEval e = single;
    e.pdf *= o.p_facets;
    e.pdf_rev *= i.p_facets;
    if (transmits) e.eta = is_above ? eta : 1 / eta;
    if (!(o.lost > 0 || i.lost > 0)) return e;
    const float mean_above = t.mean(OpenPbrTable::kLost, fixed.row),
                mean_below = t.mean(OpenPbrTable::kLostBelow, fixed.row),
                mean = i.w.z > 0 ? mean_above : mean_below;
    if (!(mean > 0)) return e;
    const GlassShares s = t.shares(fixed.row, eta);
    const auto share = [&](bool above) {
        const float through = above ? s.above : s.below;
        return transmits ? through : 1 - through;
    };
    const float share_o = share(is_above), share_i = share(i.w.z > 0);
    // Each further facet tints the light with the mean of the two colours.
    const Rgb tinted = 0.5f * (color + fixed.tint);
    const float lost = 0.5f * (mean_above + mean_below);
    const Rgb several = tinted * (1 - lost) / (Rgb(1) - tinted * lost);
    e.f += (transmits ? color : fixed.tint) * several *
           (share_o * o.lost * i.lost / mean * i.cos * kInvPi);
    e.pdf += o.lost * share_o * i.cos * kInvPi;
    e.pdf_rev += i.lost * share_i * o.cos * kInvPi;
    return e;
}

BsdfEval OpenPbrLobe::eval_slab(const Fixed& fixed, const End& o, const End& i, Vec3 m) const {
    if (!fixed.is_glass) return eval_opaque(fixed, o, i, m);
    return eval_glass(fixed, o, i, fixed.is_smooth ? BsdfEval{} : glass(fixed).eval(o.w, i.w));
}

Rgb OpenPbrLobe::passed(const Fixed& fixed, const End& o, const End& i) const {
    const bool transmits = o.w.z * i.w.z < 0;
    if (!transmits && o.w.z < 0) return Rgb(1);
    const End& above = o.w.z > 0 ? o : i;
    const End& other = transmits ? above : i;
    const Rgb T((1 - std::max(above.fuzz, other.fuzz)) * (1 - std::max(above.coat, other.coat)));
    const Rgb t = fixed.coat_color;
    if (!(fixed.coat > 0) || t == Rgb(1)) return T;
    // The colour is that for the way down and up along the normal.
    const float coat_eta = fixed.table.layers().constants().coat_eta;
    const float below_o = cos_below_coat(above.cos, coat_eta),
                below_i = cos_below_coat(other.cos, coat_eta);
    const float ways = transmits ? 0.5f / below_o : 0.5f / below_o + 0.5f / below_i;
    const auto absorbed = [&](float c) {
        return lerp(fixed.coat, 1, c > 0 ? std::pow(c, ways) : 0.0f);
    };
    return T * Rgb(absorbed(t.r), absorbed(t.g), absorbed(t.b));
}

BsdfEval OpenPbrLobe::covered(const Fixed& fixed, const BsdfEval& slab_value, const End& o,
                              const End& i, Vec3 m) const {
    BsdfEval e = slab_value;
    e.f *= passed(fixed, o, i);
    e.pdf *= o.p_slab;
    e.pdf_rev *= i.p_slab;
    if (o.w.z * i.w.z < 0) return e;
    const bool is_above = o.w.z > 0;
    e.pdf += o.p_cosine * i.cos * kInvPi;
    e.pdf_rev += i.p_cosine * o.cos * kInvPi;
    if (o.excess * i.excess > 0) {
        const float mean = fixed.taken(is_above, [&](OpenPbrTable::Side side, Vec3 weights) {
            return fixed.table.mean_taken(side, fixed.row, fixed.layers, weights);
        });
        // What the layers take passes the coat, too.
        Rgb returned = fixed.is_glass ? fixed.tint : color;
        if (fixed.coat > 0) returned *= lerp(fixed.coat, Rgb(1), fixed.coat_color);
        if (mean > 0) e.f += returned * (o.excess * i.excess / mean * i.cos * kInvPi);
    }
    if (!is_above || !(fixed.fuzz > 0 || fixed.has_rough_coat) || !(m.z > 0)) return e;
    const OpenPbrLayers& layers = fixed.table.layers();
    if (fixed.fuzz > 0)
        e.f += Rgb(fuzz_color) *
               (fixed.fuzz * layers.fuzz(fixed.layers, fuzz_roughness, o.w, i.w, m) * i.cos);
    if (fixed.has_rough_coat) {
        const Microfacet distribution = OpenPbrLayers::coat(fixed.coat_alpha);
        const float quarter_D = 0.25f * distribution.D(m), over_o = 1 / distribution.sigma(o.w),
                    over_i = 1 / distribution.sigma(i.w);
        const float F = fresnel_dielectric(dot(o.w, m), layers.constants().coat_eta).R;
        const float below_fuzz = 1 - std::max(o.fuzz, i.fuzz);
        e.f += Rgb(below_fuzz * fixed.coat * F * quarter_D * i.cos * over_o * over_i);
        e.pdf += o.p_coat * quarter_D * over_o;
        e.pdf_rev += i.p_coat * quarter_D * over_i;
    }
    return e;
}

BsdfEval OpenPbrLobe::eval(const Fixed& fixed, const End& o, const End& i) const {
    // Bare glass has its own facets.
    const Vec3 m = fixed.is_glass && !fixed.is_covered ? Vec3() : half_vector(o.w, i.w);
    const BsdfEval e = eval_slab(fixed, o, i, m);
    return fixed.is_covered ? covered(fixed, e, o, i, m) : e;
}

BsdfEval OpenPbrLobe::eval(Vec3 wo, Vec3 wi) const {
    if (is_glass() ? wo.z == 0 || wi.z == 0 : !(wo.z > 0 && wi.z > 0)) return {};
    const Fixed fixed(*this);
    return eval(fixed, end(fixed, wo), end(fixed, wi));
}

std::optional<BsdfSample> OpenPbrLobe::sample(Vec3 wo, float u_lobe, Vec2 u) const {
    if (is_glass() ? wo.z == 0 : !(wo.z > 0)) return {};
    const Fixed fixed(*this);
    const End o = end(fixed, wo);
    const float side = std::copysign(1.0f, wo.z);
    const auto to = [&](Vec3 wi) -> std::optional<BsdfSample> {
        if (!(wi.z * side > 0)) return {};
        return make_sample(wi, eval(fixed, o, end(fixed, wi)));
    };
    if (u_lobe < o.p_cosine) return to(sample_cosine_hemisphere(u) * side);
    u_lobe -= o.p_cosine;
    if (u_lobe < o.p_coat) {
        if (fixed.has_smooth_coat) return delta_event(fixed, o, false);
        return to(
            normalize(reflect(wo, OpenPbrLayers::coat(fixed.coat_alpha).sample_visible(wo, u))));
    }
    u_lobe = std::fmin((u_lobe - o.p_coat) / o.p_slab, kOneMinusEpsilon);
    const float p = o.p_facets;
    if (!fixed.is_glass) {
        if (u_lobe >= p) return to(sample_cosine_hemisphere(u));
        if (fixed.is_smooth) return delta_event(fixed, o, false);
        return to(normalize(reflect(wo, fixed.facets.sample_visible(wo, u))));
    }
    if (u_lobe >= p) {
        u_lobe = (u_lobe - p) / (1 - p);
        const GlassShares s = table->shares(fixed.row, eta);
        const bool transmits = u_lobe < (side > 0 ? s.above : s.below);
        const Vec3 wi = sample_cosine_hemisphere(u) * (transmits ? -side : side);
        if (wi.z == 0) return {};
        return make_sample(wi, eval(fixed, o, end(fixed, wi)));
    }
    u_lobe = std::fmin(u_lobe / p, kOneMinusEpsilon);
    if (fixed.is_smooth) return delta_event(fixed, o, !(u_lobe < fresnel_dielectric(wo.z, eta).R));
    const std::optional<BsdfSample> single = glass(fixed).sample(wo, u_lobe, u);
    if (!single) return {};
    const End i = end(fixed, single->wi);
    BsdfEval e = eval_glass(
        fixed, o, i, {single->weight * single->pdf, single->pdf, single->pdf_rev, single->eta});
    if (fixed.is_covered) e = covered(fixed, e, o, i, half_vector(o.w, i.w));
    return make_sample(single->wi, e);
}

std::optional<BsdfSample> OpenPbrLobe::delta_event(Vec3 wo, bool transmits) const {
    if (is_glass() ? wo.z == 0 : !(wo.z > 0)) return {};
    if (!has_delta() || (transmits && !is_glass())) return {};
    const Fixed fixed(*this);
    return delta_event(fixed, end(fixed, wo), transmits);
}

std::optional<BsdfSample> OpenPbrLobe::delta_event(const Fixed& fixed, const End& o,
                                                   bool transmits) const {
    const Vec3 wo = o.w;
    const DielectricFresnel F = fresnel_dielectric(wo.z, eta);
    if (transmits) {
        const float T = 1 - F.R;
        if (!(fixed.is_smooth && T > 0)) return {};
        const Vec3 wi = normalize(refract(wo, F));
        const End i = end(fixed, wi);
        if (!(o.p_slab > 0)) return {};
        return BsdfSample{.wi = wi,
                          .weight = color * passed(fixed, o, i) / o.p_slab,
                          .pdf = T * o.p_slab,
                          .pdf_rev = T * i.p_slab,
                          .eta = F.eta,
                          .is_delta = true};
    }
    Rgb f;
    float p = 0;
    if (fixed.is_smooth && fixed.has_facets) {
        f = fresnel(fixed, fixed.is_glass ? wo.z : o.cos) * passed(fixed, o, o);
        p = o.p_slab * (fixed.is_glass ? F.R : o.p_facets);
    }
    if (fixed.has_smooth_coat && wo.z > 0) {
        // e.coat is the albedo of a smooth coat, F, times its weight.
        f += Rgb((1 - o.fuzz) * o.coat);
        p += o.p_coat;
    }
    if (!(p > 0)) return {};
    return BsdfSample{.wi = reflect(wo), .weight = f / p, .pdf = p, .pdf_rev = p, .is_delta = true};
}

float OpenPbrLobe::max_pdf(Vec3 wo, const DirectionCone& c) const {
    if (is_glass() ? wo.z == 0 : !(wo.z > 0)) return 0;
    const Fixed fixed(*this);
    const End o = end(fixed, wo);
    const Vec3 own{0, 0, std::copysign(1.0f, wo.z)};
    const float cosine = std::fmax(c.max_cos(own), 0.0f) * kInvPi, p = o.p_facets;
    float bound = o.p_cosine * cosine;
    if (o.p_coat > 0 && fixed.has_rough_coat)
        bound += o.p_coat * OpenPbrLayers::coat(fixed.coat_alpha).max_pdf_of_reflection(wo, c);
    if (fixed.is_glass) {
        const float both = std::fmax(std::fmax(c.max_cos(own), c.max_cos(-own)), 0.0f) * kInvPi;
        const float once = fixed.is_smooth ? 0.0f : p * glass(fixed).max_pdf(wo, c);
        return bound + o.p_slab * (once + (1 - p) * both);
    }
    const float once =
        fixed.is_smooth || !fixed.has_facets ? 0.0f : p * fixed.facets.max_pdf_of_reflection(wo, c);
    return bound + o.p_slab * (once + (1 - p) * cosine);
}

Rgb OpenPbrLobe::albedo_estimate() const {
    const float F = fresnel_dielectric(1, eta).R;
    const Rgb dielectric = Rgb(tint) * F + color * (1 - F);
    Rgb albedo = is_glass() ? dielectric : lerp(metal, dielectric, color);
    const OpenPbrLayers& layers = table->layers();
    if (coat > 0) {
        const float E = fresnel_dielectric(1, layers.constants().coat_eta).R;
        albedo = lerp(coat, albedo, Rgb(E) + Rgb(coat_color) * albedo * (1 - E));
    }
    if (fuzz > 0) {
        const float E =
            layers.fuzz_albedo(layers.row(coat_roughness, fuzz_roughness), CosineNodes::place(1));
        albedo = lerp(fuzz * E, albedo, Rgb(fuzz_color));
    }
    return albedo;
}

float OpenPbrLobe::roughness() const {
    float sharpest = 1;
    if (has_facets() && !has_smooth_facets()) sharpest = std::fmin(sharpest, facets().min_alpha());
    if (coat > 0 && !has_smooth_coat()) sharpest = std::fmin(sharpest, sqr(float(coat_roughness)));
    return sharpest;
}

namespace {

class OpenPbr final : public Material {
public:
    OpenPbr(const Params& params, MaterialContext& context)
        : base_weight_(context.texture(params, "base_weight", Rgb(1), 1)),
          base_color_(context.texture(params, "base_color", Rgb(0.8f), 1)),
          diffuse_roughness_(context.texture(params, "base_diffuse_roughness", Rgb(0), 1)),
          metalness_(context.texture(params, "base_metalness", Rgb(0), 1)),
          specular_weight_(context.texture(params, "specular_weight", Rgb(1))),
          specular_color_(context.texture(params, "specular_color", Rgb(1))),
          roughness_(context.texture(params, "specular_roughness", Rgb(0.3f), 1)),
          transmission_(context.texture(params, "transmission_weight", Rgb(0), 1)),
          transmission_color_(context.texture(params, "transmission_color", Rgb(1), 1)),
          coat_(context.texture(params, "coat_weight", Rgb(0), 1)),
          coat_color_(context.texture(params, "coat_color", Rgb(1), 1)),
          coat_roughness_(context.texture(params, "coat_roughness", Rgb(0), 1)),
          fuzz_(context.texture(params, "fuzz_weight", Rgb(0), 1)),
          fuzz_color_(context.texture(params, "fuzz_color", Rgb(1), 1)),
          fuzz_roughness_(context.texture(params, "fuzz_roughness", Rgb(0.5f), 1)),
          ior_(params.number("specular_ior", 1.5f, 0.01f, 1e6f)),
          coat_ior_(params.number("coat_ior", 1.6f, 1, 100)),
          coat_affect_ior_(params.number("coat_affect_ior", 1, 0, 1)),
          coat_affect_roughness_(params.number("coat_affect_roughness", 1, 0, 1)),
          is_thin_(params.flag("thin_walled", false)) {
        OpenPbrConstants& c = constants_;
        const Surface at = surface(TexturePoint());
        const auto eta_at = [&](bool varies, float eta) {
            return varies ? (ior_ < 1 ? 0.5f : 2.0f) : eta;
        };
        const bool factor_varies =
            !specular_weight_.is_constant() || !specular_color_.is_constant();
        c.has_coat = may_be(coat_);
        c.has_fuzz = may_be(fuzz_);
        c.eta_varies = factor_varies || (coat_affect_ior_ > 0 && !coat_.is_constant());
        c.eta = eta_at(c.eta_varies, at.eta);
        c.alpha_varies = !roughness_.is_constant() ||
                         (coat_affect_roughness_ > 0 && c.has_coat && may_be(coat_roughness_) &&
                          !(coat_.is_constant() && coat_roughness_.is_constant()));
        c.alpha = c.alpha_varies ? 0 : at.alpha;
        constexpr float kLargestAspect = 1e4f;
        const float a = params.number("specular_roughness_anisotropy", 0, -1, 1);
        c.aspect = a < 0 ? 1 / std::max(1 + a, 1 / kLargestAspect) : 1 - a;
        if (c.alpha == 0 && !c.alpha_varies) c.aspect = 1;
        if (c.has_coat) {
            c.coat_eta = coat_ior_;
            c.coat_roughness_varies = !coat_roughness_.is_constant();
            if (!c.coat_roughness_varies) c.coat_roughness = at.coat_roughness;
        }
        if (c.has_fuzz) {
            c.fuzz_roughness_varies = !fuzz_roughness_.is_constant();
            if (!c.fuzz_roughness_varies)
                c.fuzz_roughness = Share16(fuzz_roughness_.eval_scalar(Vec2()));
        }
        c.has_metal = may_be(metalness_);
        c.has_dielectric = !is_one(metalness_);
        OpenPbrConstants opaque = c, glass = c;
        if (!c.has_dielectric) opaque.eta = 1.5f, opaque.eta_varies = false;
        glass.eta_varies = factor_varies;
        glass.eta = eta_at(factor_varies, at.eta_of_glass);
        glass.has_metal = glass.has_dielectric = true;
        opaque_ = SharedOpenPbrTable::of(OpenPbrSlab::Opaque, opaque);
        glass_ = SharedOpenPbrTable::of(OpenPbrSlab::Glass, glass);
        const auto vary = [](std::initializer_list<const TextureRef*> textures) {
            return std::any_of(textures.begin(), textures.end(),
                               [](const TextureRef* t) { return !t->is_constant(); });
        };
        surface_varies_ =
            vary({&specular_weight_, &specular_color_, &roughness_, &coat_, &coat_roughness_});
        varies_ = surface_varies_ || vary({&base_weight_, &base_color_, &diffuse_roughness_,
                                           &metalness_, &transmission_, &transmission_color_,
                                           &coat_color_, &fuzz_, &fuzz_color_, &fuzz_roughness_});
        evaluate<true>(TexturePoint(), constant_);
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        if (!varies_) return append(constant_, point, frame, weight, list);
        Values v = constant_;
        evaluate<false>(point.texture_point(), v);
        append(v, point, frame, weight, list);
    }
    bool needs_tangents() const override { return constants_.aspect != 1; }
    bool is_transmissive() const override { return may_be(transmission_); }
    bool is_two_sided() const override { return is_transmissive() || is_thin_; }
    bool may_be_smooth() const override {
        return constants_.alpha_varies || !has_smooth_facets() || may_be(coat_) || may_be(fuzz_) ||
               !(is_one(metalness_) || is_one(transmission_));
    }
    int max_components() const override { return 2; }
    bool may_have_delta() const override {
        return constants_.alpha_varies || has_smooth_facets() || may_be(coat_) ||
               (is_thin_ && may_be(transmission_));
    }
    Rgb mean_albedo() const override {
        const float metal = metalness_.mean().mean(),
                    glass = (1 - metal) * transmission_.mean().mean();
        return base_color_.mean() * (base_weight_.mean().mean() * (1 - glass)) +
               transmission_color_.mean() * glass;
    }

private:
    /// Where the roughness does not vary.
    bool has_smooth_facets() const {
        const Vec2 a = constants_.alphas(constants_.alpha);
        return std::max(a.x, a.y) <= Microfacet::kMinAlpha;
    }
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

    /// An index whose reflectance at normal incidence is that of `eta` times `factor`, on its side of 1.
    static float weighted(float eta, float factor) {
        if (factor == 1) return eta;
        const float root =
            std::sqrt(std::min(sqr((eta - 1) / (eta + 1)) * std::max(factor, 0.0f), kLargestR0));
        return eta < 1 ? (1 - root) / (1 + root) : (1 + root) / (1 - root);
    }
    /// Relative to the coat, but on the same side of 1, so that no light is reflected totally.
    float ior_below_coat() const {
        const float ratio = ior_ / coat_ior_;
        return (ratio < 1) == (ior_ < 1) ? ratio : 1 / ratio;
    }
    /// (r⁴ + 2 c⁴)^¼, at most 1.
    static float blurred(float r, float coat_roughness) {
        return std::sqrt(std::sqrt(std::min(1.0f, sqr(sqr(r)) + 2 * sqr(sqr(coat_roughness)))));
    }

    struct Surface {
        Rgb tint;
        float eta, eta_of_glass, alpha;
        Share16 roughness, coat, coat_roughness;
    };
    /// What the parameters of the facets and of the coat mean.
    Surface surface(const TexturePoint& at) const {
        Surface s;
        // Colours above 1 are weight.
        const Rgb color = specular_color_.eval(at);
        const float most = std::max(color.max(), 1.0f);
        s.tint = color / most;
        const float factor = specular_weight_.eval_scalar(at) * most;
        s.eta = weighted(ior_, factor);
        s.eta_of_glass = glass_eta(s.eta);
        float r = roughness_.eval_scalar(at);
        if (may_be(coat_)) {
            const float coat = coat_.eval_scalar(at),
                        coat_roughness = coat_roughness_.eval_scalar(at);
            s.coat = coat, s.coat_roughness = coat_roughness;
            if (const float share = coat * coat_affect_ior_; share > 0)
                s.eta = weighted(lerp(share, ior_, ior_below_coat()), factor);
            // The coat blurs what lies below.
            if (const float share = coat * coat_affect_roughness_; share > 0 && coat_roughness > 0)
                r = lerp(share, r, blurred(r, coat_roughness));
        }
        s.roughness = r;
        s.alpha = sqr(float(s.roughness));
        return s;
    }

    /// What the parameters are at a point; the lobe has no table yet.
    struct Values {
        OpenPbrLobe lobe{};
        Rgb transmitted;
        float eta_of_glass = 1, metal = 0, transmission = 0;
    };
    /// Sets the values of textures, or `all`.
    template <bool all>
    void evaluate(const TexturePoint& at, Values& v) const {
        const auto varies = [](const TextureRef& t) { return all || !t.is_constant(); };
        OpenPbrLobe& l = v.lobe;
        if (varies(base_color_) || varies(base_weight_))
            l.color = base_color_.eval(at) * base_weight_.eval_scalar(at);
        if (varies(diffuse_roughness_)) l.diffuse_roughness = diffuse_roughness_.eval_scalar(at);
        if (varies(metalness_)) v.metal = metalness_.eval_scalar(at);
        if (varies(transmission_)) v.transmission = transmission_.eval_scalar(at);
        if (varies(transmission_color_)) v.transmitted = transmission_color_.eval(at);
        if (all || surface_varies_) {
            const Surface s = surface(at);
            l.eta = s.eta, l.tint = s.tint, l.surface_roughness = s.roughness;
            l.coat = s.coat, l.coat_roughness = s.coat_roughness;
            v.eta_of_glass = s.eta_of_glass;
        }
        if (constants_.has_coat && varies(coat_color_)) l.coat_color = coat_color_.eval(at);
        if (!constants_.has_fuzz) return;
        if (varies(fuzz_)) l.fuzz = fuzz_.eval_scalar(at);
        if (varies(fuzz_roughness_)) l.fuzz_roughness = fuzz_roughness_.eval_scalar(at);
        if (varies(fuzz_color_)) l.fuzz_color = fuzz_color_.eval(at);
    }
    void append(const Values& v, const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const {
        const float glass = (1 - v.metal) * v.transmission;
        const Frame reflecting =
            is_two_sided() && !sees_front(point, frame) ? frame.flipped() : frame;
        OpenPbrLobe lobe = v.lobe;
        if (glass < 1) {
            lobe.table = &opaque_->get();
            lobe.metal = glass > 0 ? v.metal / (1 - glass) : v.metal;
            list.add(reflecting, lobe, weight * (1 - glass));
        }
        if (!(glass > 0)) return;
        if (is_thin_)
            return list.add(frame, ThinDielectricLobe{v.eta_of_glass, lobe.tint, v.transmitted},
                            weight * glass);
        lobe.table = &glass_->get();
        lobe.eta = v.eta_of_glass;
        lobe.color = sqrt(v.transmitted);
        list.add(frame, lobe, weight * glass);
    }

    TextureRef base_weight_, base_color_, diffuse_roughness_, metalness_, specular_weight_,
        specular_color_, roughness_, transmission_, transmission_color_, coat_, coat_color_,
        coat_roughness_, fuzz_, fuzz_color_, fuzz_roughness_;
    float ior_, coat_ior_, coat_affect_ior_, coat_affect_roughness_;
    bool is_thin_;
    OpenPbrConstants constants_;
    Values constant_;
    bool surface_varies_ = false, varies_ = false;
    std::shared_ptr<const SharedOpenPbrTable> opaque_, glass_;
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
          {"base_diffuse_roughness", ParamKind::Texture, "0",
           "Roughness of the diffuse base, in [0, 1]."},
          {"base_metalness", ParamKind::Texture, "0", "Fraction of metal, in [0, 1]."},
          {"specular_weight", ParamKind::Texture, "1",
           "Factor of the reflectance at normal incidence of what is not metal."},
          {"specular_color", ParamKind::Texture, "1",
           "Factor of the reflection of what is not metal; of metal, that at 82 degrees."},
          {"specular_roughness", ParamKind::Texture, "0.3",
           "Square root of the facets' alpha, in [0, 1]."},
          {"specular_roughness_anisotropy", ParamKind::Float, "0",
           "Stretches highlights along the u direction, or v where it is negative, in [-1, 1]."},
          {"specular_ior", ParamKind::Float, "1.5",
           "Index of refraction below the surface divided by that above it."},
          {"transmission_weight", ParamKind::Texture, "0",
           "Fraction of glass in the part that is not metal, in [0, 1]."},
          {"transmission_color", ParamKind::Texture, "1",
           "Colour of light that has passed two surfaces, in [0, 1]."},
          {"coat_weight", ParamKind::Texture, "0", "Strength of the clear coat, in [0, 1]."},
          {"coat_color", ParamKind::Texture, "1",
           "Transmittance of the coat along the normal, down and up, in [0, 1]."},
          {"coat_roughness", ParamKind::Texture, "0", "Roughness of the coat, in [0, 1]."},
          {"coat_ior", ParamKind::Float, "1.6", "Index of refraction of the coat, at least 1."},
          {"coat_affect_ior", ParamKind::Float, "1",
           "How far the index below the coat is relative to the coat's, in [0, 1]; glass keeps "
           "its own."},
          {"coat_affect_roughness", ParamKind::Float, "1",
           "How far the coat's roughness blurs what lies below, in [0, 1]."},
          {"fuzz_weight", ParamKind::Texture, "0", "Strength of the fuzz, in [0, 1]."},
          {"fuzz_color", ParamKind::Texture, "1", "Albedo of the fuzz, in [0, 1]."},
          {"fuzz_roughness", ParamKind::Texture, "0.5",
           "Roughness of the fuzz, in [0, 1]: lower values brighten the edges."},
          {"thin_walled", ParamKind::Bool, "false",
           "Whether the surface is thin: seen from both sides, with the transmission of a clear "
           "pane without roughness, "
           "coat and fuzz."}}},
        make_material<OpenPbr>};
}

}  // namespace etendue
