#include "bsdf/bsdf.h"

#include <type_traits>

namespace etendue {

static_assert(sizeof(Lobe) <= 64 && std::is_trivially_copyable_v<Lobe>);

namespace {

/// Directions in the frame of one component, with the geometric normal, and the correction that they imply for the
/// lobe's value.
class Side {
public:
    Side(Vec3 ng, bool strict, const BsdfComponent& c, Vec3 wo)
        : c_(c), strict_(strict), ng_(dot(ng, c.frame.n) < 0 ? -ng : ng), wo_(local(wo)) {}

    struct Local {
        Vec3 w;    ///< In the shading frame.
        float ng;  ///< cos to the geometric normal, turned to the side of the shading normal.
    };
    /// Whether the lobe may scatter between wo and `wi`: no light passes through the geometric surface where the lobe
    /// reflects, and none is reflected by it where the lobe transmits. With strict normals each direction is on the same
    /// side of both surfaces.
    bool allows(const Local& wi) const {
        if (strict_) return wo_.w.z * wo_.ng > 0 && wi.w.z * wi.ng > 0;
        return wo_.w.z * wi.w.z * (wo_.ng * wi.ng) > 0;
    }
    Local local(Vec3 w) const { return {c_.frame.to_local(w), dot(w, ng_)}; }
    const Local& wo() const { return wo_; }

    /// Factor from the lobe's f|wi·ns| to f̃|wi·ng|: 1/η² for radiance, and the correction for shading normals for
    /// importance [Veach 1997, p. 155].
    float correction(const Local& wi, float eta, TransportMode mode) const {
        if (mode == TransportMode::Radiance) return 1 / sqr(eta);
        return std::fabs(wo_.w.z * wi.ng / (wo_.ng * wi.w.z));
    }

private:
    const BsdfComponent& c_;
    bool strict_;
    Vec3 ng_;
    Local wo_;
};

BsdfEval eval_lobe(const Lobe& lobe, Vec3 wo, Vec3 wi) {
    if (const auto* diffuse = std::get_if<DiffuseLobe>(&lobe)) return diffuse->eval(wo, wi);
    return std::visit([&](const auto& l) { return l.eval(wo, wi); }, lobe);
}

std::optional<BsdfSample> sample_lobe(const Lobe& lobe, Vec3 wo, float u_lobe, Vec2 u) {
    if (const auto* diffuse = std::get_if<DiffuseLobe>(&lobe))
        return diffuse->sample(wo, u_lobe, u);
    return std::visit([&](const auto& l) { return l.sample(wo, u_lobe, u); }, lobe);
}

/// Value and densities of `c`, both times its weight.
BsdfEval eval_component(Vec3 ng, bool strict, const BsdfComponent& c, Vec3 wo, Vec3 wi,
                        TransportMode mode) {
    const Side side(ng, strict, c, wo);
    const Side::Local i = side.local(wi);
    if (!side.allows(i)) return {};
    BsdfEval e = eval_lobe(c.lobe, side.wo().w, i.w);
    e.f *= c.weight * side.correction(i, e.eta, mode);
    e.pdf *= c.weight;
    e.pdf_rev *= c.weight;
    return e;
}

/// Value of a BSDF of one diffuse lobe without its frame: the most frequent case.
BsdfEval eval_diffuse(Vec3 ng, bool strict, const BsdfComponent& c, const DiffuseLobe& lobe,
                      Vec3 wo, Vec3 wi, TransportMode mode) {
    const Vec3 ns = c.frame.n;
    const float side = std::copysign(1.0f, dot(ng, ns));
    const float cos_o = dot(wo, ns), cos_i = dot(wi, ns), cos_og = dot(wo, ng) * side,
                cos_ig = dot(wi, ng) * side;
    if (!(cos_o > 0 && cos_i > 0)) return {};
    if (strict ? !(cos_og > 0 && cos_ig > 0) : !(cos_og * cos_ig > 0)) return {};
    const float factor = mode == TransportMode::Radiance ? cos_i : cos_o * cos_ig / cos_og;
    return {lobe.reflectance * (factor * c.weight * kInvPi), cos_i * kInvPi, cos_o * kInvPi};
}

/// Samples eval_diffuse().
std::optional<BsdfSample> sample_diffuse(Vec3 ng, bool strict, const BsdfComponent& c,
                                         const DiffuseLobe& lobe, Vec3 wo, Vec2 u,
                                         TransportMode mode) {
    const float side = std::copysign(1.0f, dot(ng, c.frame.n));
    const float cos_o = dot(wo, c.frame.n), cos_og = dot(wo, ng) * side;
    if (!(cos_o > 0) || (strict ? !(cos_og > 0) : cos_og == 0)) return {};
    const Vec3 local = sample_cosine_hemisphere(u);
    const Vec3 wi = c.frame.to_world(local);
    const float cos_ig = dot(wi, ng) * side;
    if (!(local.z > 0) || (strict ? !(cos_ig > 0) : !(cos_og * cos_ig > 0))) return {};
    const float correction =
        mode == TransportMode::Radiance ? 1.0f : cos_o * cos_ig / (cos_og * local.z);
    return BsdfSample{.wi = wi,
                      .weight = lobe.reflectance * (correction * c.weight),
                      .pdf = local.z * kInvPi,
                      .pdf_rev = cos_o * kInvPi};
}

/// The sample that `local_sample(wo)` returns in the frame of `c`, in world space, with densities times the weight of
/// `c`. BsdfSample::weight is that of the lobe alone.
template <class LocalSample>
std::optional<BsdfSample> sample_component(Vec3 ng, bool strict, const BsdfComponent& c, Vec3 wo,
                                           TransportMode mode, const LocalSample& local_sample) {
    const Side side(ng, strict, c, wo);
    std::optional<BsdfSample> s = local_sample(side.wo().w);
    if (!s) return {};
    const Vec3 local_wi = s->wi;
    s->wi = c.frame.to_world(local_wi);
    const Side::Local i{local_wi, side.local(s->wi).ng};
    if (!side.allows(i)) return {};
    s->weight *= side.correction(i, s->eta, mode);
    s->pdf *= c.weight;
    s->pdf_rev *= c.weight;
    if (s->is_delta) {
        // δ(ω_o - T(ω_i)) = |dω_i/dω_o| δ(ω_i - T⁻¹(ω_o)), and η_o² cos θ_o dω_o = η_i² cos θ_i dω_i.
        s->pdf_rev *= std::fabs(side.wo().w.z / (local_wi.z * sqr(s->eta)));
        s->event = local_wi.z * side.wo().w.z < 0;
    }
    return s;
}

/// Adds the value of another component; η is that of the first one whose value is not zero.
void add(BsdfEval& sum, const BsdfEval& e) {
    if (sum.f.is_zero()) sum.eta = e.eta;
    sum.f += e.f;
    sum.pdf += e.pdf;
    sum.pdf_rev += e.pdf_rev;
}

}  // namespace

BsdfEval Bsdf::eval(Vec3 wo, Vec3 wi, TransportMode mode) const {
    if (const DiffuseLobe* diffuse = only_diffuse_lobe())
        return eval_diffuse(ng_, has_strict_normals_, first_, *diffuse, wo, wi, mode);
    BsdfEval sum = eval_component(ng_, has_strict_normals_, first_, wo, wi, mode);
    for (const BsdfComponent* c = first_.next; c; c = c->next)
        add(sum, eval_component(ng_, has_strict_normals_, *c, wo, wi, mode));
    sum.pdf /= total_weight_;
    sum.pdf_rev /= total_weight_;
    return sum;
}

std::optional<BsdfSample> Bsdf::sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode) const {
    if (const DiffuseLobe* diffuse = only_diffuse_lobe())
        return sample_diffuse(ng_, has_strict_normals_, first_, *diffuse, wo, u, mode);
    if (!has_smooth_ && !has_delta_) return {};
    // Walks pass no number then. Others are not read either, so that every caller samples as walks do.
    if (!uses_lobe_choice_) u_lobe = 0;
    const BsdfComponent* chosen = &first_;
    u_lobe *= total_weight_;
    for (; chosen->next && u_lobe >= chosen->weight; chosen = chosen->next)
        u_lobe -= chosen->weight;
    u_lobe = std::min(kOneMinusEpsilon, u_lobe / chosen->weight);
    std::optional<BsdfSample> s =
        sample_component(ng_, has_strict_normals_, *chosen, wo, mode, [&](Vec3 local_wo) {
            return sample_lobe(chosen->lobe, local_wo, u_lobe, u);
        });
    if (!s) return {};
    if (s->is_delta) {
        for (const BsdfComponent* c = &first_; c != chosen; c = c->next) s->event += 2;
        return normalized(*s);
    }
    if (!first_.next) return normalized(*s);

    // The other components may sample the same direction: weight = Σ f / Σ pdf.
    BsdfEval sum{s->weight * s->pdf, s->pdf, s->pdf_rev, s->eta};
    for (const BsdfComponent* c = &first_; c; c = c->next)
        if (c != chosen) add(sum, eval_component(ng_, has_strict_normals_, *c, wo, s->wi, mode));
    s->weight = sum.f / sum.pdf;
    s->pdf = sum.pdf;
    s->pdf_rev = sum.pdf_rev;
    return normalized(*s);
}

BsdfSample Bsdf::normalized(BsdfSample s) const {
    s.weight *= total_weight_;
    s.pdf /= total_weight_;
    s.pdf_rev /= total_weight_;
    return s;
}

std::optional<BsdfSample> Bsdf::sample_delta(Vec3 wo, uint8_t event, TransportMode mode) const {
    const BsdfComponent* c = &first_;
    for (int i = 0; i < event / 2 && c; ++i) c = c->next;
    if (!c) return {};
    std::optional<BsdfSample> s = sample_component(
        ng_, has_strict_normals_, *c, wo, mode, [&](Vec3 local_wo) -> std::optional<BsdfSample> {
            return std::visit(
                [&](const auto& lobe) -> std::optional<BsdfSample> {
                    if constexpr (requires { lobe.delta_event(local_wo, true); })
                        return lobe.delta_event(local_wo, event % 2 == 1);
                    return {};
                },
                c->lobe);
        });
    if (!s) return {};
    s->event = event;
    return normalized(*s);
}

float Bsdf::max_pdf(Vec3 wo, const DirectionCone& cone) const {
    float sum = 0;
    for (const BsdfComponent* c = &first_; c; c = c->next) {
        const Vec3 local_wo = c->frame.to_local(wo);
        const DirectionCone local{c->frame.to_local(cone.axis), cone.angle};
        sum += c->weight *
               std::visit([&](const auto& l) { return l.max_pdf(local_wo, local); }, c->lobe);
    }
    return sum / total_weight_;
}

float Bsdf::sum_delta_probabilities(Vec3 wo, TransportMode mode) const {
    float sum = 0;
    int event = 0;
    for (const BsdfComponent* c = &first_; c; c = c->next, event += 2)
        for (const int transmits : {0, 1})
            if (const auto s = sample_delta(wo, uint8_t(event + transmits), mode)) sum += s->pdf;
    return sum;
}

float Bsdf::sharpest_roughness() const {
    float sharpest = kInf;
    for (const BsdfComponent* c = &first_; c; c = c->next)
        std::visit(
            [&](const auto& l) {
                if (c->weight > 0 && l.has_smooth()) sharpest = std::min(sharpest, l.roughness());
            },
            c->lobe);
    return std::isfinite(sharpest) ? sharpest : 0;
}

Rgb Bsdf::albedo_estimate() const {
    Rgb sum;
    for (const BsdfComponent* c = &first_; c; c = c->next)
        sum += std::visit([](const auto& l) { return l.albedo_estimate(); }, c->lobe) * c->weight;
    return sum;
}

}  // namespace etendue
