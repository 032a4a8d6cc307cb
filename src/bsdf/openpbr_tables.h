#pragma once
// Directional albedos of the slabs and layers of `openpbr`, with which its lobes keep the energy that single scattering
// loses [Kulla & Conty 2017].

#include <array>
#include <compare>
#include <memory>
#include <vector>

#include "bsdf/coat.h"

namespace etendue {

/// The slabs of OpenPBR of which `openpbr` is a mixture: a metal mixed with a dielectric over a diffuse base, and a
/// dielectric boundary.
enum class OpenPbrSlab : uint8_t { Opaque, Glass };

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

/// What of a material determines the tables: values that do not vary over it, and which of the others do.
struct OpenPbrConstants {
    float eta = 1.5f;  ///< η below over η above; where it varies, the side of 1 on which it lies.
    bool eta_varies = false;  ///< Between 1 and infinity, or 0 and 1.
    float alpha = 0;          ///< Roughness of the facets, where it does not vary.
    bool alpha_varies = false;
    float aspect = 1;  ///< α along ∂p/∂v over α along ∂p/∂u; the mean of their squares is α².
    bool has_metal = true, has_dielectric = true;  ///< Of an opaque slab.
    bool has_coat = false, has_fuzz = false;
    float coat_eta = 1.6f;
    float coat_roughness = 0;  ///< The square root of α, where it does not vary.
    bool coat_roughness_varies = false;
    float fuzz_roughness = 0.5f;  ///< Where it does not vary.
    bool fuzz_roughness_varies = false;

    std::partial_ordering operator<=>(const OpenPbrConstants&) const = default;
    /// α along ∂p/∂u and ∂p/∂v [OpenPBR 2024].
    Vec2 alphas(float a) const {
        if (aspect == 1) return {a, a};
        const float u = a * std::sqrt(2 / (1 + sqr(aspect)));
        return {u, aspect * u};
    }
};

/// A coat over the slab, and fuzz over both: their albedos, as functions of their roughness and the cosine.
class OpenPbrLayers {
public:
    /// Where a roughness lies between rows: those of the albedos, and the kFiner times fewer of what the layers take.
    struct Place {
        int row = 0;
        float f = 0;
        int block = 0;
        float f_block = 0;
    };
    /// The places of both roughnesses.
    struct Row {
        Place coat, fuzz;
    };
    static constexpr int kMostBlocks = 17;

    explicit OpenPbrLayers(const OpenPbrConstants& constants);

    const OpenPbrConstants& constants() const { return constants_; }
    /// Numbers of roughnesses for which tables have what the layers take; 0 without the layer.
    int coat_blocks() const { return blocks_of(coat_); }
    int fuzz_blocks() const { return blocks_of(fuzz_); }
    bool has_rows() const { return coat_.size() > 1 || fuzz_.size() > 1; }
    Row row(float coat_roughness, float fuzz_roughness) const {
        return {place(coat_, clamp(coat_roughness, 0, 1)),
                place(fuzz_,
                      std::sqrt(std::max(fuzz_roughness - kLeastFuzz, 0.0f) / (1 - kLeastFuzz)))};
    }
    /// A coat is smooth below the roughness that float directions resolve.
    static Microfacet coat(float alpha) { return {Microfacet::Kind::Ggx, alpha, alpha}; }
    static bool is_smooth(float coat_alpha) { return coat_alpha <= Microfacet::kMinAlpha; }
    /// Albedo of the reflection of a rough coat.
    float coat_albedo(Row r, CosineNodes::Place p) const { return albedo(coat_, r.coat, p); }
    /// Albedo of white fuzz.
    float fuzz_albedo(Row r, CosineNodes::Place p) const { return albedo(fuzz_, r.fuzz, p); }
    /// White fuzz without the cosine: the distribution of [Estevez & Kulla 2017, §2], the denominator of
    /// [Neubelt & Pettineo 2013].
    float fuzz(Row r, float roughness, Vec3 wo, Vec3 wi, Vec3 m) const {
        const Layer* l = &fuzz_[size_t(r.fuzz.row)];
        const float scale = r.fuzz.f > 0 ? lerp(r.fuzz.f, l[0].scale, l[1].scale) : l[0].scale;
        return scale * unscaled_fuzz(roughness, wo, wi, m);
    }
    /// Albedos for one of the roughnesses of the blocks.
    float coat_at(int block, CosineNodes::Place p) const {
        return CosineNodes::at(coat_[size_t(block * kFiner)].E.data(), p);
    }
    float fuzz_at(int block, CosineNodes::Place p) const {
        return CosineNodes::at(fuzz_[size_t(block * kFiner)].E.data(), p);
    }
    /// ∫ max(E_f(o), E_f(i)) f |cos θi| dωi of the coat's reflection at a node of the cosine: what the fuzz takes of it.
    float fuzz_of_coat(int coat_block, int fuzz_block, int node) const {
        return fuzz_of_coat_[size_t(coat_block * fuzz_blocks() + fuzz_block)][size_t(node)];
    }

private:
    static constexpr float kLeastFuzz = 0.1f;
    static constexpr int kFiner = 4;
    struct Layer {
        CosineNodes::Values E{};
        float scale = 1;  ///< Of fuzz: it reflects no more than all light.
    };
    static float unscaled_fuzz(float roughness, Vec3 wo, Vec3 wi, Vec3 m) {
        const float exponent = 1 / sqr(std::max(roughness, kLeastFuzz)), sin2 = sqr(m.x) + sqr(m.y);
        const float D = (2 + exponent) * (0.5f * kInvPi) * std::pow(sin2, 0.5f * exponent);
        return D / (4 * std::fmax(wo.z + wi.z - wo.z * wi.z, 1e-6f));
    }
    using Layers = std::vector<Layer>;
    static int blocks_of(const Layers& l) {
        return l.empty() ? 0 : (int(l.size()) - 1) / kFiner + 1;
    }
    /// `x` of equidistant rows, in [0, 1].
    static Place place(const Layers& l, float x) {
        if (l.size() <= 1) return {};
        const float at = x * float(l.size() - 1);
        Place p;
        p.row = std::min(int(at), int(l.size()) - 2);
        p.f = at - float(p.row);
        p.block = p.row / kFiner;
        p.f_block = (at - float(p.block * kFiner)) / kFiner;
        return p;
    }
    static float albedo(const Layers& l, Place r, CosineNodes::Place p) {
        const Layer* row = &l[size_t(r.row)];
        const float first = CosineNodes::at(row[0].E.data(), p);
        return r.f > 0 ? lerp(r.f, first, CosineNodes::at(row[1].E.data(), p)) : first;
    }
    float roughness_of_coat(int row) const;
    float roughness_of_fuzz(int row) const;
    void make_fuzz(Layer& layer, float roughness) const;

    OpenPbrConstants constants_;
    Layers coat_, fuzz_;
    std::vector<CosineNodes::Values> fuzz_of_coat_;
};

/// Albedos of one slab below the layers, white throughout, as functions of α, η and the cosine, linear between rows. Below,
/// E_c and E_f are the albedos of the coat and of the fuzz, and f the slab's own BSDF, with ∫ f |cos θi| dωi = 1.
class OpenPbrTable {
public:
    enum Plane {
        kFacets,  ///< Opaque: the albedo E of the facets of the dielectric.
        kLost,  ///< Opaque: 1 − E of facets that reflect everything once. Glass: 1 − E for light from above.
        kLostBelow,  ///< Glass: 1 − E for light from below.
        kLarger,  ///< Opaque: ∫ max(E(o), E(i)) |cos θi|/π dωi, with E of the plane kFacets,
        kLargerBent,  ///< and the same with the factor s of Fon.
        kPlanes
    };
    /// The slab, for what its layers take: the parts of an opaque one, the sides of glass.
    enum Side { kDielectric = 0, kMetal = 1, kAbove = 0, kBelow = 1 };
    /// Rows between which is interpolated, for a roughness, an index and an azimuth.
    struct Row {
        int first;
        float f_alpha, f_eta, f_phi;
    };

    OpenPbrTable(OpenPbrSlab slab, const OpenPbrConstants& constants);

    OpenPbrSlab slab() const { return slab_; }
    const OpenPbrLayers& layers() const { return layers_; }
    /// The row of the direction `w`, from that of means.
    Row row(Row mean, Vec3 w) const {
        if (n_phi_ == 1) return mean;
        Row r = mean;
        const float x = std::atan2(std::fabs(stretch_ * w.y), std::fabs(w.x)) * (2 * kInvPi) *
                        float(n_phi_ - 1);
        const int i = std::min(int(x), n_phi_ - 2);
        r.first = mean.first * n_phi_ + i;
        r.f_phi = x - float(i);
        return r;
    }
    /// The row of means over all directions, of facets whose squared roughness is α² on average over the azimuth.
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
    // Most tables have one row, of which the values are at hand.
    float at(Plane plane, const Row& r, CosineNodes::Place p) const {
        return is_one_row_ ? CosineNodes::at(values_[plane].data(), p) : at_rows(plane, r, p);
    }
    /// 2 ∫ v(μ) μ dμ, the mean over the azimuth; `r` is a mean_row().
    float mean(Plane plane, const Row& r) const { return mean(means_[plane], r); }
    /// What the layers, with weights w_c and w_f, take of the slab's light beyond their own albedos, as the components of
    /// w_c x + w_f y + w_c w_f z:
    ///     x = ∫ max(E_c(o), E_c(i)) f |cos θi| dωi − E_c(o),   y the same of the fuzz,
    ///     z = ∫ max(E_f(o), E_f(i)) (f_c − max(E_c(o), E_c(i)) f) |cos θi| dωi,
    /// with the coat's own BSDF f_c. Of light from below it is what the layers take of the refracted light.
    /// The result is the sum with these `weights`, (w_c, w_f, w_c w_f).
    float taken(Side side, const Row& r, const OpenPbrLayers::Row& l, CosineNodes::Place p,
                Vec3 weights) const {
        if (!is_one_row_ || n_blocks_ > 1) return taken_rows(side, r, l, p, weights);
        return taken_at_nodes(taken_[side].data(), p, weights);
    }
    /// Its mean; `r` is a mean_row().
    float mean_taken(Side side, const Row& r, const OpenPbrLayers::Row& l, Vec3 weights) const {
        if (!is_one_row_ || n_blocks_ > 1) return mean_taken_rows(side, r, l, weights);
        return dot(mean_taken_[side].front(), weights);
    }
    /// Opaque: the share of several reflections between facets in what one reflection leaves.
    float interreflection(const Row& r) const { return mean(interreflection_, r); }
    /// Opaque: ∫ s |cos θi|/π dωi with the factor s of Fon, which depends on the cosine alone, and its mean.
    float bent(CosineNodes::Place p) const { return CosineNodes::at(bent_.data(), p); }
    float mean_bent() const { return mean_bent_; }
    /// Glass, for its roughness and index.
    GlassShares shares(const Row& r, float eta) const {
        return GlassShares::of({mean(transmitted_above_, r), mean(transmitted_below_, r)}, eta,
                               mean(kLost, r), mean(kLostBelow, r));
    }

private:
    static constexpr int kNodes = CosineNodes::kNodes;
    static float taken_at_nodes(const Vec3* nodes, CosineNodes::Place p, Vec3 weights) {
        return lerp(p.f, dot(nodes[p.node], weights), dot(nodes[p.node + 1], weights));
    }
    float mean(const std::vector<float>& v, const Row& r) const {
        return is_one_row_ ? v.front() : mean_rows(v, r);
    }
    /// The same of tables with several rows.
    float at_rows(Plane plane, const Row& r, CosineNodes::Place p) const;
    float mean_rows(const std::vector<float>& v, const Row& r) const;
    float taken_rows(Side side, const Row& r, const OpenPbrLayers::Row& l, CosineNodes::Place p,
                     Vec3 weights) const;
    float mean_taken_rows(Side side, const Row& r, const OpenPbrLayers::Row& l, Vec3 weights) const;
    template <class F>
    float interpolate(const Row& r, int stride, const F& value) const;
    template <class F>
    float at_nodes(const Row& r, const F& value) const;
    template <class F>
    float in_layers(const OpenPbrLayers::Row& l, const F& value) const;
    /// One combination of roughness and index: a node for each cosine and azimuth, in this order.
    struct Facets;
    class Takings;
    void make_azimuths();
    void make_row(int row, float alpha, float eta);
    void make_opaque(const Facets& facets);
    void make_glass(const Facets& facets);
    template <class F>
    void keep(Side side, const Facets& facets, int node, const F& taken);
    Vec3* taken_at(Side side, int block, int row) {
        return &taken_[side][size_t((block * n_alpha_ * n_eta_ + row) * n_phi_) * kNodes];
    }
    /// The values at the nodes.
    float* plane(Plane p, int row) { return &values_[p][size_t(row * n_phi_) * kNodes]; }

    OpenPbrSlab slab_;
    OpenPbrLayers layers_;
    int n_alpha_, n_eta_, n_phi_, n_blocks_;
    /// Rows are equidistant in atan(stretch tan φ), halfway to the space where the facets are round: albedos are nearly linear
    /// there.
    float stretch_ = 1;
    /// The azimuths of the rows, and shares of these in means.
    std::vector<double> azimuths_{0}, azimuth_weights_{1};
    bool is_one_row_ = n_alpha_ * n_eta_ * n_phi_ == 1;
    std::array<std::vector<float>, kPlanes> values_, means_;
    std::array<std::vector<Vec3>, 2> taken_, mean_taken_;  ///< By the Side; block, row, node.
    std::vector<float> interreflection_, transmitted_above_, transmitted_below_;
    CosineNodes::Values bent_{};
    float mean_bent_ = 0;
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

/// Diffuse reflection of V-shaped facets, white, once reflected, times π: f_FON = A (1 + σ s) of [Portsmouth et al. 2025], a
/// form of [Fujii 2012], with the roughness σ. `together` is sin θo sin θi cos(φo − φi).
struct Fon {
    float A, roughness;

    explicit Fon(float roughness)
        : A(1 / (1 + (0.5f - 2 * kInvPi / 3) * roughness)), roughness(roughness) {}
    static float s(float cos_o, float cos_i, float together) {
        return together > 0 ? together / std::fmax(std::fmax(cos_o, cos_i), 1e-6f) : together;
    }
    float eval(float cos_o, float cos_i, float together) const {
        return of(1, s(cos_o, cos_i, together));
    }
    /// A (∫ g + σ ∫ g s), from the integrals of a function g.
    float of(float plain, float bent) const { return A * (plain + roughness * bent); }
    /// The mean of s over the azimuth.
    static float mean_s(float cos_o, float cos_i) {
        const float together = safe_sqrt((1 - sqr(cos_o)) * (1 - sqr(cos_i))) * kInvPi;
        return s(cos_o, cos_i, together) - together;
    }
};

}  // namespace etendue
