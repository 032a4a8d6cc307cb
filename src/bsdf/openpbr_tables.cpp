#include "bsdf/openpbr_tables.h"

#include <map>
#include <mutex>
#include <numbers>

namespace etendue {
namespace {

/// Rows where α varies alone, and where η varies, too.
constexpr int kAlphaRowsOfSlab = 25, kAlphaRowsBesideEta = 17, kEtaRowsOfSlab = 17, kPhiRows = 13;
/// The squares are the numbers of normals per node. Those of glass decide on total reflection as well.
constexpr int kNormals = 32, kNormalsOfGlass = 48;
constexpr float kLargestEpsilon = 0.999f;
/// Blocks where the roughness of one layer varies, and where both do.
constexpr int kLayerBlocks = OpenPbrLayers::kMostBlocks, kBlocksOfBoth = 9;

Vec3 direction_at(float cos) {
    return {safe_sqrt((1 - cos) * (1 + cos)), 0, cos};
}

/// Calls use(m, G1, weight) for n² normals m visible from `wo`, with the masking G1(w). The weights add up to one.
template <class F>
void for_normals(int n, Vec2 alpha, Vec3 wo, const F& use) {
    if (std::max(alpha.x, alpha.y) <= Microfacet::kMinAlpha) {
        use(
            Vec3{0, 0, 1}, [](Vec3) { return 1.0f; }, 1.0);
        return;
    }
    const Microfacet facets(Microfacet::Kind::Ggx, alpha.x, alpha.y);
    const auto G1 = [&](Vec3 w) { return facets.G1(w); };
    // u = 1 − s³ has small cells in the tail of the distribution, where light is lost.
    const auto cube = [](double s) { return s * s * s; };
    for (int j = 0; j < n; ++j) {
        const double weight = (cube(double(j + 1) / n) - cube(double(j) / n)) / n;
        const auto u = float(1 - cube((j + 0.5) / n));
        for (int i = 0; i < n; ++i)
            use(facets.sample_visible(wo, {(float(i) + 0.5f) / float(n), u}), G1, weight);
    }
}

}  // namespace

float CosineNodes::cosine(int node) {
    constexpr float kGrazing = 1e-4f;
    return std::max(sqr(float(node) / (kNodes - 1)), kGrazing);
}

const std::array<double, CosineNodes::kNodes>& CosineNodes::weights() {
    // ∫ hat_j(x) 4 x³ dx, from 2 μ dμ with μ = x²: on each side of a node x_j, hat (x − x_j ± h)/h.
    static const std::array<double, kNodes> made = [] {
        std::array<double, kNodes> w{};
        const double h = 1.0 / (kNodes - 1);
        for (int j = 0; j + 1 < kNodes; ++j) {
            const double a = j * h, b = a + h;
            const auto power = [&](int n) { return std::pow(b, n) - std::pow(a, n); };
            const double rising = 4 / h * (power(5) / 5 - a * power(4) / 4);
            w[size_t(j) + 1] += rising;
            w[size_t(j)] += power(4) - rising;
        }
        return w;
    }();
    return made;
}

double CosineNodes::mean(const Values& v) {
    return mean_of([&](int j) { return v[size_t(j)]; });
}

OpenPbrLayers::OpenPbrLayers(const OpenPbrConstants& constants) : constants_(constants) {
    const bool both = constants.coat_roughness_varies && constants.fuzz_roughness_varies;
    const auto rows = [&](bool varies) {
        return varies ? size_t(((both ? kBlocksOfBoth : kLayerBlocks) - 1) * kFiner + 1) : 1;
    };
    if (constants.has_coat) coat_.resize(rows(constants.coat_roughness_varies));
    if (constants.has_fuzz) fuzz_.resize(rows(constants.fuzz_roughness_varies));
    for (size_t f = 0; f < fuzz_.size(); ++f) make_fuzz(fuzz_[f], roughness_of_fuzz(int(f)));
    fuzz_of_coat_.resize(size_t(coat_blocks() * fuzz_blocks()));
    for (int c = 0; c < int(coat_.size()); ++c) {
        const float alpha = sqr(roughness_of_coat(c));
        const int n_fuzz = c % kFiner == 0 ? fuzz_blocks() : 0;
        for (int j = 0; j < CosineNodes::kNodes; ++j) {
            const Vec3 wo = direction_at(CosineNodes::cosine(j));
            const CosineNodes::Place o = CosineNodes::place(wo.z);
            double sum = 0;
            std::array<double, kMostBlocks> of_fuzz{};
            for_normals(kNormals, {alpha, alpha}, wo, [&](Vec3 m, const auto& G1, double weight) {
                const Vec3 wi = reflect(wo, m);
                if (!(wi.z > 0)) return;
                const double part =
                    weight * double(fresnel_dielectric(dot(wo, m), constants.coat_eta).R * G1(wi));
                sum += part;
                const CosineNodes::Place i = CosineNodes::place(wi.z);
                for (int f = 0; f < n_fuzz; ++f)
                    of_fuzz[size_t(f)] += part * double(std::max(fuzz_at(f, o), fuzz_at(f, i)));
            });
            coat_[size_t(c)].E[size_t(j)] = float(sum);
            for (int f = 0; f < n_fuzz; ++f)
                fuzz_of_coat_[size_t(c / kFiner * fuzz_blocks() + f)][size_t(j)] =
                    float(of_fuzz[size_t(f)]);
        }
    }
}

float OpenPbrLayers::roughness_of_coat(int row) const {
    if (coat_.size() == 1) return constants_.coat_roughness;
    return float(row) / float(coat_.size() - 1);
}

float OpenPbrLayers::roughness_of_fuzz(int row) const {
    if (fuzz_.size() == 1) return constants_.fuzz_roughness;
    return lerp(sqr(float(row) / float(fuzz_.size() - 1)), kLeastFuzz, 1.0f);
}

void OpenPbrLayers::make_fuzz(Layer& layer, float roughness) const {
    constexpr int kSteps = 64;
    float most = 1;
    for (int j = 0; j < CosineNodes::kNodes; ++j) {
        const Vec3 wo = direction_at(CosineNodes::cosine(j));
        double sum = 0;
        for (int a = 0; a < kSteps; ++a)
            for (int b = 0; b < kSteps; ++b) {
                // μ = x² for the sharp edge at the horizon; dω = 2 x dx dφ, of both halves.
                const float x = (float(a) + 0.5f) / kSteps, phi = (float(b) + 0.5f) * kPi / kSteps;
                const float cos = sqr(x), sin = safe_sqrt(1 - sqr(cos));
                const Vec3 wi{sin * std::cos(phi), sin * std::sin(phi), cos}, h = wo + wi;
                sum += double(unscaled_fuzz(roughness, wo, wi, h / length(h)) * cos * 2 * x * 2 *
                              kPi) /
                       (kSteps * kSteps);
            }
        layer.E[size_t(j)] = float(sum);
        most = std::max(most, float(sum));
    }
    layer.scale = 1 / most;
    for (float& v : layer.E) v /= most;
}

/// Facets of one roughness and index.
struct OpenPbrTable::Facets {
    int row;
    const std::vector<double>&azimuths, &weights;
    Vec2 alpha;
    float eta;

    int nodes() const { return int(azimuths.size()) * CosineNodes::kNodes; }
    float cosine(int node) const { return CosineNodes::cosine(node % CosineNodes::kNodes); }
    Vec3 direction(int node) const {
        const Vec3 w = direction_at(cosine(node));
        const auto phi = float(azimuths[size_t(node / CosineNodes::kNodes)]);
        return {w.x * std::cos(phi), w.x * std::sin(phi), w.z};
    }
    /// 2 ∫ v(μ) μ dμ, the mean over the azimuth of what is linear between rows.
    template <class F>
    double mean_of(const F& value) const {
        double sum = 0;
        for (int j = 0; j < nodes(); ++j) sum += weight(j) * double(value(j));
        return sum;
    }
    double weight(int node) const {
        return weights[size_t(node / CosineNodes::kNodes)] *
               CosineNodes::weights()[size_t(node % CosineNodes::kNodes)];
    }
    double mean(const std::vector<float>& v) const {
        return mean_of([&](int j) { return v[size_t(j)]; });
    }
};

/// What the layers take of the light that a slab scatters from one node of the cosine.
class OpenPbrTable::Takings {
public:
    /// The albedos of all rows of the layers that act on one direction of light.
    struct Albedos {
        std::array<float, OpenPbrLayers::kMostBlocks> coat, fuzz;
    };
    Takings(const OpenPbrLayers& layers, int node)
        : layers_(layers), node_(node),
          own_(of(layers, CosineNodes::place(CosineNodes::cosine(node)))) {}

    static Albedos of(const OpenPbrLayers& layers, CosineNodes::Place p) {
        Albedos a;
        for (int c = 0; c < layers.coat_blocks(); ++c) a.coat[size_t(c)] = layers.coat_at(c, p);
        for (int f = 0; f < layers.fuzz_blocks(); ++f) a.fuzz[size_t(f)] = layers.fuzz_at(f, p);
        return a;
    }
    Albedos of(CosineNodes::Place p) const { return of(layers_, p); }
    /// Of light that is reflected.
    Albedos larger(CosineNodes::Place p) const {
        Albedos a = of(p);
        for (int c = 0; c < layers_.coat_blocks(); ++c)
            a.coat[size_t(c)] = std::max(a.coat[size_t(c)], own_.coat[size_t(c)]);
        for (int f = 0; f < layers_.fuzz_blocks(); ++f)
            a.fuzz[size_t(f)] = std::max(a.fuzz[size_t(f)], own_.fuzz[size_t(f)]);
        return a;
    }
    /// Of light that is refracted from above.
    const Albedos& own() const { return own_; }
    /// Adds a share of the light.
    void add(double share, const Albedos& a) {
        for (int c = 0; c < layers_.coat_blocks(); ++c) {
            const double taken = share * double(a.coat[size_t(c)]);
            coat_[size_t(c)] += taken;
            for (int f = 0; f < layers_.fuzz_blocks(); ++f)
                both_[size_t(c)][size_t(f)] += taken * double(a.fuzz[size_t(f)]);
        }
        for (int f = 0; f < layers_.fuzz_blocks(); ++f)
            fuzz_[size_t(f)] += share * double(a.fuzz[size_t(f)]);
    }
    /// OpenPbrTable::taken() for rows of the layers, which may be missing.
    Vec3 from_above(int c, int f) const {
        Vec3 t = from_below(c, f);
        if (c < layers_.coat_blocks()) t.x -= own_.coat[size_t(c)];
        if (f < layers_.fuzz_blocks()) t.y -= own_.fuzz[size_t(f)];
        if (c < layers_.coat_blocks() && f < layers_.fuzz_blocks())
            t.z += layers_.fuzz_of_coat(c, f, node_);
        return t;
    }
    Vec3 from_below(int c, int f) const {
        return {float(coat_[size_t(c)]), float(fuzz_[size_t(f)]),
                -float(both_[size_t(c)][size_t(f)])};
    }

private:
    template <class T>
    using PerBlock = std::array<T, OpenPbrLayers::kMostBlocks>;
    const OpenPbrLayers& layers_;
    int node_;
    Albedos own_;
    PerBlock<double> coat_{}, fuzz_{};
    PerBlock<PerBlock<double>> both_{};
};

OpenPbrTable::OpenPbrTable(OpenPbrSlab slab, const OpenPbrConstants& constants)
    : slab_(slab), layers_(constants), n_alpha_(!constants.alpha_varies ? 1
                                                : constants.eta_varies  ? kAlphaRowsBesideEta
                                                                        : kAlphaRowsOfSlab),
      n_eta_(constants.eta_varies ? kEtaRowsOfSlab : 1),
      n_phi_(constants.aspect == 1 ? 1 : kPhiRows),
      n_blocks_(constants.has_coat || constants.has_fuzz
                    ? std::max(layers_.coat_blocks(), 1) * std::max(layers_.fuzz_blocks(), 1)
                    : 0) {
    if (n_phi_ > 1) make_azimuths();
    const auto rows = size_t(n_alpha_ * n_eta_);
    for (auto& v : values_) v.resize(rows * size_t(n_phi_) * kNodes);
    for (auto& m : means_) m.resize(rows);
    for (auto& t : taken_) t.resize(size_t(n_blocks_) * rows * size_t(n_phi_) * kNodes);
    for (auto& m : mean_taken_) m.resize(size_t(n_blocks_) * rows);
    for (auto* v : {&interreflection_, &transmitted_above_, &transmitted_below_}) v->resize(rows);
    for (int j = 0; j < kNodes; ++j)
        bent_[size_t(j)] = float(CosineNodes::mean_of(
            [&](int k) { return Fon::mean_s(CosineNodes::cosine(j), CosineNodes::cosine(k)); }));
    mean_bent_ = float(CosineNodes::mean(bent_));
    for (int e = 0; e < n_eta_; ++e)
        for (int a = 0; a < n_alpha_; ++a) {
            float eta = constants.eta, alpha = constants.alpha;
            if (n_alpha_ > 1) alpha = sqr(float(a) / float(n_alpha_ - 1));
            if (n_eta_ > 1) {
                const float epsilon = std::min(sqr(float(e) / float(n_eta_ - 1)), kLargestEpsilon);
                eta = (1 + epsilon) / (1 - epsilon);
                if (constants.eta < 1) eta = 1 / eta;
            }
            make_row(e * n_alpha_ + a, alpha, eta);
        }
}

void OpenPbrTable::make_azimuths() {
    constexpr float kLeastAspect = 1e-4f;
    stretch_ = std::sqrt(clamp(layers_.constants().aspect, kLeastAspect, 1 / kLeastAspect));
    const double quarter = 0.5 * std::numbers::pi;
    const auto azimuth = [&](double row) {
        const double x = row / (n_phi_ - 1);
        return x < 1 ? std::atan(std::tan(quarter * x) / double(stretch_)) : quarter;
    };
    azimuths_.resize(size_t(n_phi_));
    azimuth_weights_.assign(size_t(n_phi_), 0);
    constexpr int kSteps = 256;
    for (int row = 0; row < n_phi_; ++row) azimuths_[size_t(row)] = azimuth(row);
    for (int row = 0; row + 1 < n_phi_; ++row)
        for (int i = 0; i < kSteps; ++i) {
            const double f = (i + 0.5) / kSteps, share = (azimuth(row + double(i + 1) / kSteps) -
                                                          azimuth(row + double(i) / kSteps)) /
                                                         quarter;
            azimuth_weights_[size_t(row)] += (1 - f) * share;
            azimuth_weights_[size_t(row) + 1] += f * share;
        }
}

void OpenPbrTable::make_row(int row, float alpha, float eta) {
    const Facets facets{row, azimuths_, azimuth_weights_, layers_.constants().alphas(alpha), eta};
    switch (slab_) {
    case OpenPbrSlab::Opaque: make_opaque(facets); break;
    case OpenPbrSlab::Glass: make_glass(facets); break;
    }
    for (int p = 0; p < kPlanes; ++p)
        means_[size_t(p)][size_t(row)] =
            float(facets.mean_of([&](int j) { return plane(Plane(p), row)[j]; }));
    for (const int side : {0, 1})
        for (int block = 0; block < n_blocks_; ++block) {
            const Vec3* v = taken_at(Side(side), block, row);
            const auto mean = [&](float Vec3::*part) {
                return float(facets.mean_of([&](int j) { return v[j].*part; }));
            };
            mean_taken_[size_t(side)][size_t(block * n_alpha_ * n_eta_ + row)] = {
                mean(&Vec3::x), mean(&Vec3::y), mean(&Vec3::z)};
        }
}

/// Keeps what the layers take from one node on.
template <class F>
void OpenPbrTable::keep(Side side, const Facets& facets, int node, const F& taken) {
    const int n_fuzz = std::max(layers_.fuzz_blocks(), 1);
    for (int block = 0; block < n_blocks_; ++block)
        taken_at(side, block, facets.row)[node] = taken(block / n_fuzz, block % n_fuzz);
}

void OpenPbrTable::make_opaque(const Facets& facets) {
    const OpenPbrConstants& c = layers_.constants();
    const auto n = size_t(facets.nodes());
    std::vector<float> E(n), lost(n);
    std::vector<Takings> metal, dielectric;
    for (int j = 0; j < facets.nodes(); ++j) {
        const Vec3 wo = facets.direction(j);
        Takings of_metal(layers_, j % kNodes), of_dielectric = of_metal;
        double all = 0, reflected = 0;
        for_normals(kNormals, facets.alpha, wo, [&](Vec3 m, const auto& G1, double weight) {
            const Vec3 wi = reflect(wo, m);
            if (!(wi.z > 0)) return;
            const double part = weight * double(G1(wi)),
                         F = double(fresnel_dielectric(dot(wo, m), facets.eta).R);
            all += part;
            reflected += part * F;
            if (n_blocks_ == 0) return;
            const Takings::Albedos larger = of_metal.larger(CosineNodes::place(wi.z));
            if (c.has_metal) of_metal.add(part, larger);
            if (c.has_dielectric) of_dielectric.add(part * F, larger);
        });
        E[size_t(j)] = float(reflected);
        lost[size_t(j)] = std::max(0.0f, float(1 - all));
        metal.push_back(of_metal), dielectric.push_back(of_dielectric);
    }
    const double below = 1 - facets.mean(E), mean_lost = facets.mean(lost);
    // Light that is reflected again and again, each time with the mean reflectance [Kulla & Conty 2017].
    const double F = double(fresnel_diffuse_reflectance(facets.eta));
    const double again = F * F * (1 - mean_lost) / (1 - F * mean_lost);
    interreflection_[size_t(facets.row)] =
        below > 0 ? float(std::clamp(again * mean_lost / below, 0.0, 1.0)) : 1.0f;
    for (int j = 0; j < facets.nodes(); ++j) {
        const auto o = size_t(j);
        // The separable lobes: of light that facets reflect several times, and of the diffuse base.
        for (int k = 0; n_blocks_ > 0 && k < facets.nodes(); ++k) {
            const auto i = size_t(k);
            const double share = facets.weight(k);
            const Takings::Albedos larger = metal[o].larger(CosineNodes::place(facets.cosine(k)));
            if (mean_lost > 0) metal[o].add(share * double(lost[o] * lost[i]) / mean_lost, larger);
            if (below > 0)
                dielectric[o].add(share * double((1 - E[o]) * (1 - E[i])) / below, larger);
        }
        keep(kMetal, facets, j,
             [&](int coat, int fuzz) { return metal[o].from_above(coat, fuzz); });
        keep(kDielectric, facets, j,
             [&](int coat, int fuzz) { return dielectric[o].from_above(coat, fuzz); });
        plane(kFacets, facets.row)[j] = E[o];
        plane(kLost, facets.row)[j] = lost[o];
        const auto larger_E = [&](int k) { return std::max(E[o], E[size_t(k)]); };
        plane(kLarger, facets.row)[j] = float(facets.mean_of(larger_E));
        plane(kLargerBent, facets.row)[j] = float(facets.mean_of(
            [&](int k) { return larger_E(k) * Fon::mean_s(facets.cosine(j), facets.cosine(k)); }));
    }
}

void OpenPbrTable::make_glass(const Facets& facets) {
    const auto n = size_t(facets.nodes());
    // Of light from above [0] and below [1]: what is lost, and what the layers take.
    std::array<std::vector<float>, 2> lost{std::vector<float>(n), std::vector<float>(n)};
    std::array<std::vector<Takings>, 2> taken;
    for (const int side : {0, 1})
        for (int j = 0; j < facets.nodes(); ++j) {
            // From below, the boundary is turned over.
            const Vec3 wo = facets.direction(j);
            const float eta_io = side == 0 ? facets.eta : 1 / facets.eta;
            Takings& t = taken[size_t(side)].emplace_back(layers_, j % kNodes);
            double all = 0;
            for_normals(
                n_eta_ > 1 ? kNormals : kNormalsOfGlass, facets.alpha, wo,
                [&](Vec3 m, const auto& G1, double weight) {
                    const DielectricFresnel fresnel = fresnel_dielectric(dot(wo, m), eta_io);
                    if (const Vec3 wi = reflect(wo, m); wi.z > 0) {
                        const double part = weight * double(fresnel.R * G1(wi));
                        all += part;
                        if (side == 0) t.add(part, t.larger(CosineNodes::place(wi.z)));
                    }
                    if (const Vec3 wi = refract(wo, m, fresnel); fresnel.R < 1 && wi.z < 0) {
                        const double part = weight * double((1 - fresnel.R) * G1(wi));
                        all += part;
                        t.add(part, side == 0 ? t.own() : t.of(CosineNodes::place(-wi.z)));
                    }
                });
            lost[size_t(side)][size_t(j)] = std::max(0.0f, float(1 - all));
        }
    const double mean_above = facets.mean(lost[0]);
    const GlassShares transmitted{1 - fresnel_diffuse_reflectance(facets.eta),
                                  1 - fresnel_diffuse_reflectance(1 / facets.eta)};
    transmitted_above_[size_t(facets.row)] = transmitted.above;
    transmitted_below_[size_t(facets.row)] = transmitted.below;
    const GlassShares shares =
        GlassShares::of(transmitted, facets.eta, float(mean_above), float(facets.mean(lost[1])));
    for (int j = 0; j < facets.nodes(); ++j) {
        const auto o = size_t(j);
        Takings &up = taken[0][o], &down = taken[1][o];
        // Of the light that is lost, a share is reflected and a share transmitted above.
        up.add(double(shares.above * lost[0][o]), up.own());
        for (int k = 0; mean_above > 0 && n_blocks_ > 0 && k < facets.nodes(); ++k) {
            const double share = facets.weight(k) * double(lost[0][size_t(k)]) / mean_above;
            const CosineNodes::Place i = CosineNodes::place(facets.cosine(k));
            up.add(share * double((1 - shares.above) * lost[0][o]), up.larger(i));
            down.add(share * double(shares.below * lost[1][o]), down.of(i));
        }
        keep(kAbove, facets, j, [&](int coat, int fuzz) { return up.from_above(coat, fuzz); });
        keep(kBelow, facets, j, [&](int coat, int fuzz) { return down.from_below(coat, fuzz); });
        plane(kLost, facets.row)[j] = lost[0][o];
        plane(kLostBelow, facets.row)[j] = lost[1][o];
    }
}

template <class F>
float OpenPbrTable::interpolate(const Row& r, int stride, const F& value) const {
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

template <class F>
float OpenPbrTable::at_nodes(const Row& r, const F& value) const {
    return interpolate(r, n_phi_, [&](int row) {
        const float first = value(row);
        return r.f_phi > 0 ? lerp(r.f_phi, first, value(row + 1)) : first;
    });
}

/// Between blocks of rows, one for each pair of roughnesses of coat and fuzz.
template <class F>
float OpenPbrTable::in_layers(const OpenPbrLayers::Row& l, const F& value) const {
    const int stride = std::max(layers_.fuzz_blocks(), 1),
              block = l.coat.block * stride + l.fuzz.block;
    float v = value(block);
    if (l.fuzz.f_block > 0) v = lerp(l.fuzz.f_block, v, value(block + 1));
    if (l.coat.f_block > 0) {
        float next = value(block + stride);
        if (l.fuzz.f_block > 0) next = lerp(l.fuzz.f_block, next, value(block + stride + 1));
        v = lerp(l.coat.f_block, v, next);
    }
    return v;
}

float OpenPbrTable::at_rows(Plane plane, const Row& r, CosineNodes::Place p) const {
    const float* v = values_[plane].data();
    return at_nodes(r, [&](int row) { return CosineNodes::at(v + row * kNodes, p); });
}

float OpenPbrTable::mean_rows(const std::vector<float>& v, const Row& r) const {
    return interpolate(r, 1, [&](int row) { return v[size_t(row)]; });
}

float OpenPbrTable::taken_rows(Side side, const Row& r, const OpenPbrLayers::Row& l,
                               CosineNodes::Place p, Vec3 weights) const {
    const int rows = n_alpha_ * n_eta_ * n_phi_;
    return in_layers(l, [&](int block) {
        const Vec3* first = &taken_[side][size_t(block * rows) * kNodes];
        return at_nodes(r,
                        [&](int row) { return taken_at_nodes(first + row * kNodes, p, weights); });
    });
}

float OpenPbrTable::mean_taken_rows(Side side, const Row& r, const OpenPbrLayers::Row& l,
                                    Vec3 weights) const {
    return in_layers(l, [&](int block) {
        const Vec3* first = &mean_taken_[side][size_t(block * n_alpha_ * n_eta_)];
        return interpolate(r, 1, [&](int row) { return dot(first[row], weights); });
    });
}

std::shared_ptr<SharedOpenPbrTable> SharedOpenPbrTable::of(OpenPbrSlab slab,
                                                           const OpenPbrConstants& constants) {
    static std::mutex mutex;
    static std::map<std::pair<OpenPbrSlab, OpenPbrConstants>, std::weak_ptr<SharedOpenPbrTable>>
        all;
    const std::lock_guard lock(mutex);
    std::erase_if(all, [](const auto& known) { return known.second.expired(); });
    std::weak_ptr<SharedOpenPbrTable>& known = all[{slab, constants}];
    std::shared_ptr<SharedOpenPbrTable> shared = known.lock();
    if (!shared) known = shared = std::make_shared<SharedOpenPbrTable>(slab, constants);
    return shared;
}

}  // namespace etendue
