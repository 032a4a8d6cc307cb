#include "bsdf/openpbr_tables.h"

#include <map>
#include <mutex>

namespace etendue {
namespace {

/// Rows where α varies alone, and where η varies, too.
constexpr int kAlphaRowsOfSlab = 25, kAlphaRowsBesideEta = 17, kEtaRowsOfSlab = 17, kPhiRows = 9;
/// The squares are the numbers of normals per node. Those of glass decide on total reflection as well.
constexpr int kNormals = 32, kNormalsOfGlass = 48;
constexpr float kLargestEpsilon = 0.999f;

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

/// The mean of fon() over the azimuth.
float mean_fon(float roughness, float cos_o, float cos_i) {
    const float together = safe_sqrt((1 - sqr(cos_o)) * (1 - sqr(cos_i)));
    return 0.5f * (fon(roughness, cos_o, cos_i, 2 * kInvPi * together) +
                   fon(roughness, cos_o, cos_i, -2 * kInvPi * together));
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
    constexpr float kLeastFuzz = 0.1f;
    fuzz_exponent_ = 1 / sqr(std::max(constants.fuzz_roughness, kLeastFuzz));
    for (int j = 0; j < CosineNodes::kNodes; ++j) {
        const Vec3 wo = direction_at(CosineNodes::cosine(j));
        double coat = 0, fuzz_sum = 0;
        if (constants.has_coat && !has_smooth_coat())
            for_normals(kNormals, {constants.coat_alpha, constants.coat_alpha}, wo,
                        [&](Vec3 m, const auto& G1, double weight) {
                            const Vec3 wi = reflect(wo, m);
                            if (wi.z > 0)
                                coat +=
                                    weight *
                                    double(fresnel_dielectric(dot(wo, m), constants.coat_eta).R *
                                           G1(wi));
                        });
        if (constants.has_fuzz) {
            constexpr int kSteps = 64;
            for (int a = 0; a < kSteps; ++a)
                for (int b = 0; b < kSteps; ++b) {
                    // μ = x² for the sharp edge at the horizon; dω = 2 x dx dφ, of both halves.
                    const float x = (float(a) + 0.5f) / kSteps,
                                phi = (float(b) + 0.5f) * kPi / kSteps;
                    const float cos = sqr(x), sin = safe_sqrt(1 - sqr(cos));
                    const Vec3 wi{sin * std::cos(phi), sin * std::sin(phi), cos}, h = wo + wi;
                    fuzz_sum += double(fuzz(wo, wi, h / length(h)) * cos * 2 * x * 2 * kPi) /
                                (kSteps * kSteps);
                }
        }
        coat_[size_t(j)] = float(coat);
        fuzz_[size_t(j)] = float(fuzz_sum);
    }
    mean_coat_ = 0;
    for (int j = 0; j < CosineNodes::kNodes; ++j)
        mean_coat_ += constants.has_coat ? float(CosineNodes::weights()[size_t(j)]) *
                                               coat_albedo(CosineNodes::cosine(j))
                                         : 0.0f;
    // No more than all light is reflected.
    float most = 1;
    for (const float v : fuzz_) most = std::max(most, v);
    fuzz_scale_ = 1 / most;
    for (float& v : fuzz_) v /= most;
}

/// Facets of one roughness and index.
struct OpenPbrTable::Facets {
    int row, n_phi;
    Vec2 alpha;
    float eta;

    int nodes() const { return n_phi * CosineNodes::kNodes; }
    float cosine(int node) const { return CosineNodes::cosine(node % CosineNodes::kNodes); }
    Vec3 direction(int node) const {
        const Vec3 w = direction_at(cosine(node));
        if (n_phi == 1) return w;
        const float phi = 0.5f * kPi * float(node / CosineNodes::kNodes) / float(n_phi - 1);
        return {w.x * std::cos(phi), w.x * std::sin(phi), w.z};
    }
    /// 2 ∫ v(μ) μ dμ, the mean over the azimuth by the trapezoidal rule.
    template <class F>
    double mean_of(const F& value) const {
        double sum = 0;
        for (int p = 0; p < n_phi; ++p) {
            const double share = n_phi == 1                 ? 1.0
                                 : p == 0 || p == n_phi - 1 ? 0.5 / (n_phi - 1)
                                                            : 1.0 / (n_phi - 1);
            sum += share *
                   CosineNodes::mean_of([&](int k) { return value(p * CosineNodes::kNodes + k); });
        }
        return sum;
    }
    double mean(const std::vector<float>& v) const {
        return mean_of([&](int j) { return v[size_t(j)]; });
    }
};

OpenPbrTable::OpenPbrTable(OpenPbrSlab slab, const OpenPbrConstants& constants)
    : layers_(constants), n_alpha_(!constants.alpha_varies ? 1
                                   : constants.eta_varies  ? kAlphaRowsBesideEta
                                                           : kAlphaRowsOfSlab),
      n_eta_(constants.eta_varies ? kEtaRowsOfSlab : 1),
      n_phi_(constants.aspect == 1 ? 1 : kPhiRows) {
    const auto rows = size_t(n_alpha_ * n_eta_);
    for (auto& v : values_) v.resize(rows * size_t(n_phi_) * CosineNodes::kNodes);
    for (auto& m : means_) m.resize(rows);
    for (auto* v : {&interreflection_, &transmitted_above_, &transmitted_below_}) v->resize(rows);
    for (int j = 0; j < CosineNodes::kNodes; ++j) {
        const float cos_o = CosineNodes::cosine(j);
        lost_by_diffuse_[size_t(j)] =
            1 - float(CosineNodes::mean_of([&](int k) {
                return mean_fon(constants.diffuse_roughness, cos_o, CosineNodes::cosine(k));
            }));
    }
    mean_lost_by_diffuse_ = float(CosineNodes::mean(lost_by_diffuse_));
    for (int e = 0; e < n_eta_; ++e)
        for (int a = 0; a < n_alpha_; ++a) {
            float eta = constants.eta, alpha = constants.alpha;
            if (n_alpha_ > 1) alpha = sqr(float(a) / float(n_alpha_ - 1));
            if (n_eta_ > 1) {
                const float epsilon = std::min(sqr(float(e) / float(n_eta_ - 1)), kLargestEpsilon);
                eta = (1 + epsilon) / (1 - epsilon);
                if (constants.eta < 1) eta = 1 / eta;
            }
            make_row(slab, e * n_alpha_ + a, alpha, eta);
        }
}

void OpenPbrTable::make_row(OpenPbrSlab slab, int row, float alpha, float eta) {
    const OpenPbrConstants& c = layers_.constants();
    const Facets facets{row, n_phi_, c.alphas(alpha), eta};
    Layer coat, fuzz;
    for (int k = 0; k < CosineNodes::kNodes; ++k) {
        const float cos = CosineNodes::cosine(k);
        if (c.has_coat) coat.E[size_t(k)] = layers_.coat_albedo(cos);
        if (c.has_fuzz) fuzz.E[size_t(k)] = layers_.fuzz_albedo(cos);
    }
    const auto make = [&](const Layer& layer, Plane above, Plane below) {
        switch (slab) {
        case OpenPbrSlab::Metal: return make_metal(facets, layer, above);
        case OpenPbrSlab::Opaque: return make_opaque(facets, layer, above);
        case OpenPbrSlab::Glass: return make_glass(facets, layer, above, below);
        }
    };
    make(coat, kCoatExcess, kCoatExcessBelow);
    if (c.has_fuzz) make(fuzz, kFuzzExcess, kFuzzExcessBelow);
    for (int p = 0; p < kPlanes; ++p)
        means_[size_t(p)][size_t(row)] =
            float(facets.mean_of([&](int j) { return plane(Plane(p), row)[j]; }));
}

void OpenPbrTable::make_metal(const Facets& facets, const Layer& layer, Plane excess) {
    const auto n = size_t(facets.nodes());
    std::vector<float> lost(n), taken(n);
    for (int j = 0; j < facets.nodes(); ++j) {
        const Vec3 wo = facets.direction(j);
        double reflected = 0, sum = 0;
        for_normals(kNormals, facets.alpha, wo, [&](Vec3 m, const auto& G1, double weight) {
            const Vec3 wi = reflect(wo, m);
            if (!(wi.z > 0)) return;
            const double part = weight * double(G1(wi));
            reflected += part;
            sum += part * double(std::max(layer.of(j), layer.at(wi.z)));
        });
        lost[size_t(j)] = std::max(0.0f, float(1 - reflected));
        taken[size_t(j)] = float(sum);
    }
    const double mean = facets.mean(lost);
    for (int j = 0; j < facets.nodes(); ++j) {
        const auto o = size_t(j);
        double again = 0;
        if (mean > 0)
            again = double(lost[o]) / mean *
                    facets.mean_of([&](int k) { return layer.larger(j, k) * lost[size_t(k)]; });
        plane(kBase, facets.row)[j] = lost[o];
        plane(excess, facets.row)[j] = std::max(0.0f, taken[o] + float(again) - layer.of(j));
    }
}

void OpenPbrTable::make_opaque(const Facets& facets, const Layer& layer, Plane excess) {
    const auto n = size_t(facets.nodes());
    std::vector<float> E(n), lost(n), taken(n);
    for (int j = 0; j < facets.nodes(); ++j) {
        const Vec3 wo = facets.direction(j);
        double all = 0, reflected = 0, sum = 0;
        for_normals(kNormals, facets.alpha, wo, [&](Vec3 m, const auto& G1, double weight) {
            const Vec3 wi = reflect(wo, m);
            if (!(wi.z > 0)) return;
            const double part = weight * double(G1(wi)),
                         F = double(fresnel_dielectric(dot(wo, m), facets.eta).R);
            all += part;
            reflected += part * F;
            sum += part * F * double(std::max(layer.of(j), layer.at(wi.z)));
        });
        E[size_t(j)] = float(reflected);
        lost[size_t(j)] = std::max(0.0f, float(1 - all));
        taken[size_t(j)] = float(sum);
    }
    const double below = 1 - facets.mean(E);
    // Light that is reflected again and again, each time with the mean reflectance [Kulla & Conty 2017].
    const double mean_lost = facets.mean(lost);
    const double F = double(fresnel_diffuse_reflectance(facets.eta));
    const double again = F * F * (1 - mean_lost) / (1 - F * mean_lost);
    interreflection_[size_t(facets.row)] =
        below > 0 ? float(std::clamp(again * mean_lost / below, 0.0, 1.0)) : 1.0f;
    const float roughness = layers_.constants().diffuse_roughness;
    for (int j = 0; j < facets.nodes(); ++j) {
        const auto o = size_t(j);
        double diffuse = 0;
        if (below > 0)
            diffuse = double(1 - E[o]) / below * facets.mean_of([&](int k) {
                return layer.larger(j, k) * (1 - E[size_t(k)]);
            });
        plane(kBase, facets.row)[j] = E[o];
        plane(kRoughDiffuse, facets.row)[j] =
            float(facets.mean_of([&](int k) {
                return std::max(E[o], E[size_t(k)]) *
                       mean_fon(roughness, facets.cosine(j), facets.cosine(k));
            })) -
            E[o];
        plane(excess, facets.row)[j] = std::max(0.0f, taken[o] + float(diffuse) - layer.of(j));
    }
}

void OpenPbrTable::make_glass(const Facets& facets, const Layer& layer, Plane above, Plane below) {
    const auto n = size_t(facets.nodes());
    // Of light from above [0] and below [1]: what is lost, and what the layer takes.
    std::array<std::vector<float>, 2> lost{std::vector<float>(n), std::vector<float>(n)},
        taken = lost;
    for (const int side : {0, 1})
        for (int j = 0; j < facets.nodes(); ++j) {
            // From below, the boundary is turned over.
            const Vec3 wo = facets.direction(j);
            const float eta_io = side == 0 ? facets.eta : 1 / facets.eta;
            double all = 0, sum = 0;
            for_normals(
                n_eta_ > 1 ? kNormals : kNormalsOfGlass, facets.alpha, wo,
                [&](Vec3 m, const auto& G1, double weight) {
                    const DielectricFresnel fresnel = fresnel_dielectric(dot(wo, m), eta_io);
                    if (const Vec3 wi = reflect(wo, m); wi.z > 0) {
                        const double part = weight * double(fresnel.R * G1(wi));
                        all += part;
                        if (side == 0)
                            sum += part * double(std::max(0.0f, layer.at(wi.z) - layer.of(j)));
                    }
                    if (const Vec3 wi = refract(wo, m, fresnel); fresnel.R < 1 && wi.z < 0) {
                        const double part = weight * double((1 - fresnel.R) * G1(wi));
                        all += part;
                        if (side == 1) sum += part * double(layer.at(-wi.z));
                    }
                });
            lost[size_t(side)][size_t(j)] = std::max(0.0f, float(1 - all));
            taken[size_t(side)][size_t(j)] = float(sum);
        }
    const double mean_above = facets.mean(lost[0]), mean_below = facets.mean(lost[1]);
    const GlassShares transmitted{1 - fresnel_diffuse_reflectance(facets.eta),
                                  1 - fresnel_diffuse_reflectance(1 / facets.eta)};
    transmitted_above_[size_t(facets.row)] = transmitted.above;
    transmitted_below_[size_t(facets.row)] = transmitted.below;
    const GlassShares shares =
        GlassShares::of(transmitted, facets.eta, float(mean_above), float(mean_below));
    for (int j = 0; j < facets.nodes(); ++j) {
        const auto o = size_t(j);
        // Of the light that is lost, a share is reflected and a share transmitted above.
        double up = double(taken[0][o]), down = double(taken[1][o]);
        if (mean_above > 0) {
            up += double((1 - shares.above) * lost[0][o]) / mean_above * facets.mean_of([&](int k) {
                return (layer.larger(j, k) - layer.of(j)) * lost[0][size_t(k)];
            });
            down += double(shares.below * lost[1][o]) / mean_above *
                    facets.mean_of([&](int k) { return layer.of(k) * lost[0][size_t(k)]; });
        }
        plane(kBase, facets.row)[j] = lost[0][o];
        plane(kBaseBelow, facets.row)[j] = lost[1][o];
        plane(above, facets.row)[j] = std::max(0.0f, float(up));
        plane(below, facets.row)[j] = std::max(0.0f, float(down));
    }
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
