#pragma once

#include "bsdf/openpbr_tables.h"
#include "bsdf/roughdielectric.h"

namespace etendue {

/// One slab of OpenPBR below a coat and fuzz; see openpbr.cpp. White slabs and layers reflect, or transmit, all light.
struct OpenPbrLobe {
    Rgb color;  ///< Metal: reflectance F0. Opaque: albedo of the base. Glass: factor of refraction.
    /// Opaque, glass: factor of the reflection, at most 1. Metal: factor of Schlick's reflectance at 82°.
    Rgb tint;
    float alpha_x, alpha_y;  ///< Up to Microfacet::kMinAlpha the facets are smooth.
    float eta;               ///< η below the surface over η above; 1 only in opaque slabs.
    float coat, fuzz;        ///< Their weights.
    OpenPbrSlab slab;
    const OpenPbrTable* table;  ///< That of the slab, which outlives the lobe.

    BsdfEval eval(Vec3 wo, Vec3 wi) const;
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u) const;
    std::optional<BsdfSample> delta_event(Vec3 wo, bool transmits) const;
    float max_pdf(Vec3 wo, const DirectionCone& c) const;
    Rgb albedo_estimate() const;
    float roughness() const;
    bool has_smooth() const {
        return slab == OpenPbrSlab::Opaque || !has_smooth_facets() || is_covered();
    }
    static constexpr bool kUsesLobeChoice = true;
    bool has_delta() const { return (has_smooth_facets() && has_facets()) || has_smooth_coat(); }

private:
    /// What the tables say of one of the two directions.
    struct End {
        Vec3 w;
        float cos;
        OpenPbrTable::Row row;
        CosineNodes::Place place;
        float base;  ///< The table's kBase, or kBaseBelow.
        // Albedos of coat and fuzz and their excess, times their weights, as seen from above; from below the excess alone.
        float coat = 0, fuzz = 0, coat_excess = 0, fuzz_excess = 0;
        // Probabilities of sampling a direction of fuzz or excess, of the coat, and of the slab.
        float p_cosine = 0, p_coat = 0, p_slab = 1;
    };
    End end(Vec3 w) const;
    OpenPbrTable::Row mean_row() const { return table->mean_row(alpha(), eta); }
    float alpha() const {
        return alpha_x == alpha_y ? alpha_x : std::sqrt(0.5f * (sqr(alpha_x) + sqr(alpha_y)));
    }

    bool has_smooth_facets() const { return std::fmax(alpha_x, alpha_y) <= Microfacet::kMinAlpha; }
    bool has_facets() const { return slab != OpenPbrSlab::Opaque || eta != 1; }
    bool is_covered() const { return coat > 0 || fuzz > 0; }
    bool has_smooth_coat() const { return coat > 0 && table->layers().has_smooth_coat(); }
    /// The weight of the fuzz for light that the slab reflects: the coat reflects the rest.
    float fuzz_below_coat() const { return fuzz * (1 - coat * table->layers().mean_coat_albedo()); }
    Microfacet facets() const { return {Microfacet::Kind::Ggx, alpha_x, alpha_y}; }

    /// F at a facet: Schlick's with the factor at 82° for a metal, else that of a dielectric, tinted.
    Rgb fresnel(float cos_m) const;
    /// Colour of light that metal facets reflect several times, where one reflection loses this share on average.
    Rgb interreflected(float lost) const;
    Rgb base_of_opaque(float interreflection) const { return lerp(interreflection, color, tint); }
    /// Colour of the light that the slab gives back beneath the layers.
    Rgb excess_color() const;
    /// The share of the slab's samples that goes to the facets; `interreflection` is that of the table of an opaque slab.
    float facet_probability(const End& e, float interreflection) const;
    float facet_probability(const End& e) const;

    BsdfEval eval(const End& o, Vec3 wi) const;
    BsdfEval eval_slab(const End& o, const End& i) const;
    BsdfEval eval_opaque(const End& o, const End& i) const;
    BsdfEval eval_metal(const End& o, const End& i) const;
    BsdfEval eval_glass(const End& o, const End& i, const BsdfEval& single) const;
    RoughDielectricLobe glass() const { return {facets(), eta, tint, color}; }
    /// One reflection at rough facets, which are sampled with these probabilities.
    BsdfEval eval_facets(const End& o, const End& i, float p_o, float p_i) const;
    /// Factor of the slab's light by the layers above.
    Rgb passed(const End& o, const End& i) const;
    BsdfEval covered(const BsdfEval& slab, const End& o, const End& i) const;
};

}  // namespace etendue
