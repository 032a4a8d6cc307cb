#pragma once
// Directional albedos of the slabs and layers of `openpbr`, with which its lobes keep the energy that single scattering
// loses [Kulla & Conty 2017].

#include <array>
#include <compare>
#include <memory>
#include <vector>

#include "bsdf/coat.h"

namespace etendue {

/// The slabs of OpenPBR of which `openpbr` is a mixture: a metal, a dielectric over a diffuse base, a dielectric boundary.
enum class OpenPbrSlab : uint8_t { Metal, Opaque, Glass };

/// A function of the cosine at kNodes equidistant values of √cos θ, linear between them. The weights integrate
/// 2 ∫ v(μ) μ dμ exactly, so that a lobe v(μo) v(μi) / (π v̄) has the albedo v(μo).
struct CosineNodes {
    static constexpr int kNodes = 32;
    using Values = std::array<float, kNodes>;

    /// The least cosine is not zero, where formulas are 0/0.
    static float cosine(int node);
    /// 2 ∫ v(μ) μ dμ.
    static double mean(const Values& v);
    /// 2 ∫ v(μ) μ dμ of a function of the node.
    template <class F>
    static double mean_of(const F& value) {
        double sum = 0;
        for (int j = 0; j < kNodes; ++j) sum += weights()[size_t(j)] * double(value(j));
        return sum;
    }
    static const std::array<double, kNodes>& weights();

    /// Where a cosine lies between nodes.
    struct Place {
        int node;
        float f;
    };
    static Place place(float cos) {
        const float x = std::sqrt(clamp(cos, 0, 1)) * (kNodes - 1);
        const int node = std::min(int(x), kNodes - 2);
        return {node, x - float(node)};
    }
    static float at(const float* values, Place p) {
        return lerp(p.f, values[p.node], values[p.node + 1]);
    }
};

/// Of the light that a rough dielectric boundary loses by single scattering, the shares that it transmits from above and
/// from below; the rest is reflected. They make the lobes adjoint to each other,
///     above · lost_above = below · η² · lost_below,
/// and come as near to the transmittances for diffuse light as this allows.
struct GlassShares {
    float above, below;

    /// Of transmittances for diffuse light, the η below over η above, and the mean losses.
    static GlassShares of(GlassShares transmittance, float eta, float lost_above,
                          float lost_below) {
        const float from_below = sqr(eta) * lost_below;
        if (!(lost_above > 0 && from_below > 0)) return transmittance;
        const float share =
            std::min(transmittance.above, transmittance.below * from_below / lost_above);
        return {share, share * lost_above / from_below};
    }
};

/// What of a material does not vary over it, and so determines the tables.
struct OpenPbrConstants {
    float eta = 1.5f;  ///< η below over η above; where it varies, the side of 1 on which it lies.
    bool eta_varies = false;  ///< Between 1 and infinity, or 0 and 1.
    float alpha = 0;          ///< Roughness of the facets, where it does not vary.
    bool alpha_varies = false;
    float aspect = 1;  ///< α along ∂p/∂v over α along ∂p/∂u; the mean of their squares is α².
    float diffuse_roughness = 0;  ///< That of EON, in [0, 1].
    bool has_coat = false, has_fuzz = false;
    float coat_alpha = 0, coat_eta = 1.6f;
    Rgb coat_color{1};  ///< Transmittance at normal incidence, for the way down and up.
    float fuzz_roughness = 0.5f;
    Rgb fuzz_color{1};

    std::partial_ordering operator<=>(const OpenPbrConstants& o) const {
        return numbers() <=> o.numbers();
    }
    bool operator==(const OpenPbrConstants& o) const { return numbers() == o.numbers(); }
    /// α along ∂p/∂u and ∂p/∂v [OpenPBR 2024].
    Vec2 alphas(float a) const {
        if (aspect == 1) return {a, a};
        const float u = a * std::sqrt(2 / (1 + sqr(aspect)));
        return {u, aspect * u};
    }

private:
    std::array<float, 17> numbers() const {
        return {eta,          float(eta_varies), alpha,           float(alpha_varies),
                aspect,       diffuse_roughness, float(has_coat), float(has_fuzz),
                coat_alpha,   coat_eta,          coat_color.r,    coat_color.g,
                coat_color.b, fuzz_roughness,    fuzz_color.r,    fuzz_color.g,
                fuzz_color.b};
    }
};

/// A coat over the slab, and fuzz over both.
class OpenPbrLayers {
public:
    explicit OpenPbrLayers(const OpenPbrConstants& constants);

    const OpenPbrConstants& constants() const { return constants_; }
    /// A coat is smooth below the roughness that float directions resolve.
    bool has_smooth_coat() const { return constants_.coat_alpha <= Microfacet::kMinAlpha; }
    Microfacet coat() const {
        return {Microfacet::Kind::Ggx, constants_.coat_alpha, constants_.coat_alpha};
    }
    /// Albedo of the coat's reflection.
    float coat_albedo(float cos) const {
        if (has_smooth_coat()) return fresnel_dielectric(cos, constants_.coat_eta).R;
        return CosineNodes::at(coat_.data(), CosineNodes::place(cos));
    }
    float mean_coat_albedo() const { return mean_coat_; }  ///< 2 ∫ E(μ) μ dμ.
    /// Albedo of white fuzz.
    float fuzz_albedo(float cos) const {
        return CosineNodes::at(fuzz_.data(), CosineNodes::place(cos));
    }
    /// White fuzz without the cosine: the distribution of [Estevez & Kulla 2017, §2], the denominator of
    /// [Neubelt & Pettineo 2013].
    float fuzz(Vec3 wo, Vec3 wi, Vec3 m) const {
        const float sin2 = sqr(m.x) + sqr(m.y);
        const float D =
            (2 + fuzz_exponent_) * (0.5f * kInvPi) * std::pow(sin2, 0.5f * fuzz_exponent_);
        return fuzz_scale_ * D / (4 * std::fmax(wo.z + wi.z - wo.z * wi.z, 1e-6f));
    }

private:
    OpenPbrConstants constants_;
    float fuzz_exponent_, fuzz_scale_ = 1, mean_coat_ = 0;
    CosineNodes::Values coat_{}, fuzz_{};
};

/// Albedos of one slab, white throughout, as functions of α, η and the cosine, linear between rows. Below, E_c and E_f are
/// the albedos of the coat and of the fuzz, and f the slab's own BSDF.
class OpenPbrTable {
public:
    enum Plane {
        /// Metal: 1 − E, E being the albedo of facets that reflect everything once. Opaque: the albedo E of the facets of the
        /// dielectric. Glass: 1 − E for light from above, with E that of reflection and refraction.
        kBase,
        kBaseBelow,  ///< Glass: 1 − E for light from below.
        /// Opaque: ∫ max(E(o), E(i)) f_FON |cos θi| dωi − E(o), which is negative at most by what f_FON loses.
        kRoughDiffuse,
        kCoatExcess,  ///< ∫ max(E_c(o), E_c(i)) f |cos θi| dωi − E_c(o).
        kCoatExcessBelow,  ///< Glass: the share of light from below that is refracted and then kept by the coat.
        kFuzzExcess,  ///< As for the coat.
        kFuzzExcessBelow,
        kPlanes
    };
    /// Rows between which is interpolated, for a roughness, an index and an azimuth.
    struct Row {
        int first;
        float f_alpha, f_eta, f_phi;
    };

    OpenPbrTable(OpenPbrSlab slab, const OpenPbrConstants& constants);

    const OpenPbrLayers& layers() const { return layers_; }
    /// The row of the direction `w` of facets whose squared roughness is α² on average over the azimuth.
    Row row(float alpha, float eta, Vec3 w) const {
        Row r = mean_row(alpha, eta);
        r.first *= n_phi_;
        if (n_phi_ > 1) {
            const float x =
                std::atan2(std::fabs(w.y), std::fabs(w.x)) * (2 * kInvPi) * float(n_phi_ - 1);
            const int i = std::min(int(x), n_phi_ - 2);
            r.first += i;
            r.f_phi = x - float(i);
        }
        return r;
    }
    /// The row of means over all directions.
    Row mean_row(float alpha, float eta) const {
        Row r{0, 0, 0, 0};
        if (n_alpha_ > 1) {
            const float x = std::sqrt(clamp(alpha, 0, 1)) * float(n_alpha_ - 1);
            const int i = std::min(int(x), n_alpha_ - 2);
            r.first = i;
            r.f_alpha = x - float(i);
        }
        if (n_eta_ > 1) {
            const float x = std::sqrt(std::fabs(eta - 1) / (eta + 1)) * float(n_eta_ - 1);
            const int i = std::min(int(x), n_eta_ - 2);
            r.first += i * n_alpha_;
            r.f_eta = x - float(i);
        }
        return r;
    }
    float at(Plane plane, Row r, CosineNodes::Place p) const {
        const std::vector<float>& v = values_[plane];
        return interpolate(r, n_phi_, [&](int row) {
            const float* values = &v[size_t(row) * CosineNodes::kNodes];
            const float first = CosineNodes::at(values, p);
            if (!(r.f_phi > 0)) return first;
            return lerp(r.f_phi, first, CosineNodes::at(values + CosineNodes::kNodes, p));
        });
    }
    /// 2 ∫ v(μ) μ dμ, the mean over the azimuth; `r` is a mean_row().
    float mean(Plane plane, Row r) const {
        return interpolate(r, 1, [&](int row) { return means_[plane][size_t(row)]; });
    }
    /// Opaque: the share of several reflections between facets in what one reflection leaves.
    float interreflection(Row r) const {
        return interpolate(r, 1, [&](int row) { return interreflection_[size_t(row)]; });
    }
    /// Glass, for its roughness and index.
    GlassShares shares(Row r, float eta) const {
        const auto transmittance = [&](const std::vector<float>& v) {
            return interpolate(r, 1, [&](int row) { return v[size_t(row)]; });
        };
        return GlassShares::of(
            {transmittance(transmitted_above_), transmittance(transmitted_below_)}, eta,
            mean(kBase, r), mean(kBaseBelow, r));
    }
    /// 1 − the albedo of f_FON, which only depends on the diffuse roughness, and its mean.
    float lost_by_diffuse(CosineNodes::Place p) const {
        return CosineNodes::at(lost_by_diffuse_.data(), p);
    }
    float mean_lost_by_diffuse() const { return mean_lost_by_diffuse_; }

private:
    template <class F>
    float interpolate(Row r, int stride, const F& value) const {
        float v = value(r.first);
        if (r.f_alpha > 0) v = lerp(r.f_alpha, v, value(r.first + stride));
        if (r.f_eta > 0) {
            const int next_row = r.first + stride * n_alpha_;
            float next = value(next_row);
            if (r.f_alpha > 0) next = lerp(r.f_alpha, next, value(next_row + stride));
            v = lerp(r.f_eta, v, next);
        }
        return v;
    }
    /// One combination of roughness and index: a node for each cosine and azimuth, in this order.
    struct Facets;
    /// The albedo of a layer above the slab at the nodes of the cosine; 0 without one.
    struct Layer {
        CosineNodes::Values E{};
        float at(float cos) const { return CosineNodes::at(E.data(), CosineNodes::place(cos)); }
        float of(int node) const { return E[size_t(node % CosineNodes::kNodes)]; }
        float larger(int o, int i) const { return std::max(of(o), of(i)); }
    };
    void make_row(OpenPbrSlab slab, int row, float alpha, float eta);
    void make_metal(const Facets& facets, const Layer& layer, Plane excess);
    void make_opaque(const Facets& facets, const Layer& layer, Plane excess);
    void make_glass(const Facets& facets, const Layer& layer, Plane above, Plane below);
    /// The values at the nodes.
    float* plane(Plane p, int row) {
        return &values_[p][size_t(row * n_phi_) * CosineNodes::kNodes];
    }

    OpenPbrLayers layers_;
    int n_alpha_, n_eta_, n_phi_;
    std::array<std::vector<float>, kPlanes> values_, means_;
    std::vector<float> interreflection_, transmitted_above_, transmitted_below_;
    CosineNodes::Values lost_by_diffuse_{};
    float mean_lost_by_diffuse_ = 0;
};

/// A table that is computed when it is first needed. Materials with the same constants share it.
class SharedOpenPbrTable {
public:
    static std::shared_ptr<SharedOpenPbrTable> of(OpenPbrSlab slab,
                                                  const OpenPbrConstants& constants);

    SharedOpenPbrTable(OpenPbrSlab slab, const OpenPbrConstants& constants)
        : slab_(slab), constants_(constants) {}
    const OpenPbrTable& get() const {
        return value_.get([this] { return OpenPbrTable(slab_, constants_); });
    }

private:
    OpenPbrSlab slab_;
    OpenPbrConstants constants_;
    MadeOnce<OpenPbrTable> value_;
};

/// Diffuse reflection of V-shaped facets, white, once reflected, times π: f_FON of [Portsmouth et al. 2025], a
/// form of [Fujii 2012]. `together` is sin θo sin θi cos(φo − φi).
inline float fon(float roughness, float cos_o, float cos_i, float together) {
    const float A = 1 / (1 + (0.5f - 2 * kInvPi / 3) * roughness);
    const float s = together > 0 ? together / std::fmax(std::fmax(cos_o, cos_i), 1e-6f) : together;
    return A * (1 + roughness * s);
}

}  // namespace etendue
