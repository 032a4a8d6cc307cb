#pragma once

#include "bsdf/openpbr_tables.h"
#include "bsdf/roughdielectric.h"

namespace etendue {

/// A number in [0, 1] in 16 bits. 0, 1 and, up to the rounding of float, numbers of two decimal places are exact.
class Share16 {
public:
    constexpr Share16(float v = 0)
        : n_(uint16_t(int(kOne * std::min(1.0f, std::max(0.0f, v)) + 0.5f))) {}
    constexpr operator float() const { return float(int(n_)) * (1 / kOne); }

private:
    static constexpr float kOne = 60000;
    uint16_t n_;
};
/// A colour of such numbers.
class Rgb16 {
public:
    constexpr Rgb16() = default;
    constexpr Rgb16(Rgb c) : r_(c.r), g_(c.g), b_(c.b) {}
    constexpr operator Rgb() const { return {r_, g_, b_}; }

private:
    Share16 r_, g_, b_;
};

/// The opaque slab of OpenPBR or its glass, below a coat and fuzz; see openpbr.cpp. White slabs and layers reflect, or
/// transmit, all light.
struct OpenPbrLobe {
    const OpenPbrTable* table;  ///< That of the slab, which outlives the lobe.
    Rgb color;  ///< Opaque: albedo of the base, reflectance F0 of metal. Glass: factor of refraction.
    float eta;  ///< η below the surface over η above; 1 only in opaque slabs.
    /// Factor of the reflection of a dielectric. Metal: factor of Schlick's reflectance at 82°.
    Rgb16 tint;
    Share16
        surface_roughness;  ///< The square root of α. Up to Microfacet::kMinAlpha the facets are smooth.
    Share16 diffuse_roughness, metal;  ///< Of an opaque slab; `metal` is the share of it.
    Share16 coat, coat_roughness;      ///< The weight, and the square root of α.
    Share16 fuzz, fuzz_roughness;
    Rgb16 coat_color, fuzz_color;

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const;
    Rgb albedo_estimate() const;
    float roughness() const;
    bool has_smooth() const {
        return !has_smooth_facets() || is_covered() || (!is_glass() && metal < 1);
    }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return (has_smooth_facets() && has_facets()) || has_smooth_coat(); }
    bool is_glass() const { return table->slab() == OpenPbrSlab::Glass; }
    Microfacet facets() const { return facets_of(sqr(float(surface_roughness))); }

private:
    /// What is the same for all directions.
    struct Fixed {
        explicit Fixed(const OpenPbrLobe& lobe);
        Fixed(const OpenPbrLobe& lobe, float alpha);

        const OpenPbrTable& table;
        OpenPbrTable::Row row;  ///< Of means.
        Microfacet facets;
        bool is_glass, is_smooth, has_facets = true, is_covered = false;
        bool has_smooth_coat = false, has_rough_coat = false;
        Rgb tint;
        bool is_white;  ///< The tint is.
        float most_tint, most_color;
        float metal, interreflection = 0;
        float coat = 0, coat_alpha = 0, fuzz = 0;
        Rgb coat_color{1};
        OpenPbrLayers::Row layers;

        /// What the layers take of light that returns to one side, from the sums of the table for both parts of an opaque
        /// slab.
        template <class Sum>
        float taken(bool is_above, const Sum& sum) const;
    };
    /// What the tables say of one of the two directions.
    struct End {
        Vec3 w;
        float cos;
        OpenPbrTable::Row row;
        CosineNodes::Place place;
        float facets = 0;  ///< The table's kFacets,
        float lost = 0;    ///< and kLost or kLostBelow.
        // Albedos of coat and fuzz times their weights, as seen from above, and what the layers take beyond these.
        float coat = 0, fuzz = 0, excess = 0;
        // Probabilities of sampling a direction of fuzz or excess, of the coat, and of the slab; and in it of one facet.
        float p_cosine = 0, p_coat = 0, p_slab = 1, p_facets;
    };
    End end(const Fixed& fixed, Vec3 w) const;
    float facet_probability(const Fixed& fixed, const End& e) const;

    Microfacet facets_of(float alpha) const {
        const Vec2 a = table->layers().constants().alphas(alpha);
        return {Microfacet::Kind::Ggx, a.x, a.y};
    }
    bool has_smooth_facets() const { return facets_are_smooth(facets()); }
    static bool facets_are_smooth(const Microfacet& f) {
        return std::max(f.alpha_x(), f.alpha_y()) <= Microfacet::kMinAlpha;
    }
    bool has_facets() const { return is_glass() || metal > 0 || eta != 1; }
    bool is_covered() const { return coat > 0 || fuzz > 0; }
    bool has_smooth_coat() const {
        return coat > 0 && OpenPbrLayers::is_smooth(sqr(float(coat_roughness)));
    }

    /// F at a facet: of a metal Schlick's with the factor at 82°, of a dielectric the tinted one.
    Rgb fresnel(const Fixed& fixed, float cos_m) const;
    /// Colour of light that metal facets reflect several times, where one reflection loses this share on average.
    Rgb interreflected(const Fixed& fixed, float lost) const;

    std::optional<BsdfSample> delta_event(const Fixed& fixed, const End& o, bool transmits) const;
    BsdfEval eval(const Fixed& fixed, const End& o, const End& i) const;
    /// `m`: the half vector of both directions.
    BsdfEval eval_slab(const Fixed& fixed, const End& o, const End& i, Vec3 m) const;
    BsdfEval eval_opaque(const Fixed& fixed, const End& o, const End& i, Vec3 m) const;
    BsdfEval eval_glass(const Fixed& fixed, const End& o, const End& i,
                        const BsdfEval& single) const;
    /// π times the BSDF of the diffuse base.
    Rgb diffuse_base(const Fixed& fixed, const End& o, const End& i) const;
    RoughDielectricLobe glass(const Fixed& fixed) const {
        return {fixed.facets, eta, fixed.tint, color};
    }
    /// One reflection at rough facets.
    BsdfEval eval_facets(const Fixed& fixed, const End& o, const End& i, Vec3 m) const;
    /// Factor of the slab's light by the layers above.
    Rgb passed(const Fixed& fixed, const End& o, const End& i) const;
    BsdfEval covered(const Fixed& fixed, const BsdfEval& slab, const End& o, const End& i,
                     Vec3 m) const;
};

}  // namespace etendue
