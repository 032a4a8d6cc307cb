#include "pathspace/vertex.h"

#include "guide/guide.h"

namespace etendue {

// What walks and joins move most. A larger one costs memory traffic at every vertex.
static_assert(sizeof(Vertex) <= 312 && sizeof(Bsdf) <= 144 && sizeof(BsdfSample) <= 44 &&
              sizeof(SurfaceHit) <= 144);

namespace {

constexpr TransportMode other(TransportMode mode) {
    return mode == TransportMode::Radiance ? TransportMode::Importance : TransportMode::Radiance;
}

float delta_probability(const Vertex& v, Vec3 from, TransportMode mode) {
    return v.kind == Vertex::Kind::Surface ? v.bsdf.delta_probability(from, mode) : 0.0f;
}

}  // namespace

float guide_share(const Vertex& v, const GuideCell& cell, TransportMode mode) {
    const bool is_surface = v.kind == Vertex::Kind::Surface;
    return cell.field(mode).share[is_surface ? size_t(guide_class(v.gloss)) : size_t(0)];
}

GuideView guide_view(const Vertex& v, const GuideCell& cell, Vec3 from) {
    if (v.kind == Vertex::Kind::Emitter) return emission_view(*v.emitter, cell, v.p, v.ng);
    const bool leaves_on_its_side = !v.shape->material->is_transmissive();
    const Vec3 normal = !leaves_on_its_side ? Vec3{} : dot(v.ng, from) < 0 ? -v.ng : v.ng;
    return {cell.center - v.p, normal};
}

GuideView emission_view(const Emitter& emitter, const GuideCell& cell, Vec3 p, Vec3 ng) {
    return {cell.center - p, emitter.emits_by_cosine() ? ng : Vec3{}};
}

bool Vertex::is_guided(TransportMode mode) const {
    return guide && guide_share(*this, *guide, mode) > 0;
}

WalkContribution expected_contribution(const Vertex& v, const GuideCell& cell, TransportMode mode) {
    return cell.field(mode).contribution[cube_face(facing_normal(v))];
}

void Vertex::set_guide(const GuideCell& cell, TransportMode mode, bool both) {
    guide = nullptr;
    if (!is_connectible) return;
    const float rev_share = both ? guide_share(*this, cell, other(mode)) : 0.0f;
    if (!(guide_share(*this, cell, mode) > 0 || rev_share > 0)) return;
    guide = &cell;
    guide_rev =
        rev_share > 0 ? cell.field(other(mode)).mixture.pdf(guide_view(*this, cell, wo), wo) : 0.0f;
}

float guided_pdf(const Vertex& v, const GuideCell& cell, Vec3 from, Vec3 w, TransportMode mode,
                 float unguided) {
    const float a = guide_share(v, cell, mode);
    if (!(a > 0 && unguided > 0)) return unguided;
    return (1 - a) * unguided + a * (1 - delta_probability(v, from, mode)) *
                                    cell.field(mode).mixture.pdf(guide_view(v, cell, from), w);
}

void Vertex::mix_guide(Vec3 w, TransportMode mode, float& pdf, float& reverse) const {
    pdf = guided_pdf(*this, *guide, wo, w, mode, pdf);
    const TransportMode rev = other(mode);
    if (const float a = guide_share(*this, *guide, rev); a > 0 && reverse > 0)
        reverse = (1 - a) * reverse + a * (1 - delta_probability(*this, w, rev)) * guide_rev;
}

std::optional<BsdfSample> Vertex::sample_guided(float u_lobe, Vec2 u, float u_guide,
                                                TransportMode mode) const {
    std::optional<BsdfSample> s = sample_unguided(u_lobe, u, mode);
    if (s && s->is_delta) return s;
    BsdfEval e;
    const float a = guide_share(*this, *guide, mode);
    if (u_guide < a) {
        const Vec3 w = guide->field(mode).mixture.sample(
            guide_view(*this, *guide, wo), std::fmin(u_guide / a, kOneMinusEpsilon), u);
        e = eval_unguided(w, mode);
        if (!(e.pdf > 0)) return {};
        s.emplace();
        s->wi = w;
        s->eta = e.eta;
    } else {
        if (!s) return {};
        e = {s->weight * s->pdf, s->pdf, s->pdf_rev, s->eta};
    }
    const float unguided = e.pdf;
    mix_guide(s->wi, mode, e.pdf, e.pdf_rev);
    s->weight = e.f / e.pdf;
    s->pdf = e.pdf;
    s->pdf_rev = e.pdf_rev;
    constexpr float kMostGain = 1e6f;  // where the BSDF would hardly sample the direction
    s->gain = std::fmin(e.pdf / unguided, kMostGain);
    return s;
}

float Vertex::max_pdf_unguided(const DirectionCone& cone) const {
    if (const auto normal = cosine_normal()) return cone.max_cosine_pdf(*normal);
    return kind == Kind::Emitter ? emitter->max_pdf_d() : bsdf.max_pdf(wo, cone);
}

float Vertex::max_guided_pdf(float unguided, const DirectionCone& cone, TransportMode mode) const {
    const float a = guide_share(*this, *guide, mode);
    if (!(a > 0)) return unguided;
    const float guided = guide->field(mode).mixture.max_pdf(guide_view(*this, *guide, wo), cone);
    return (1 - a) * unguided + a * (1 - delta_probability(*this, wo, mode)) * guided;
}

float learned_selection_pmf(const LightSelection& lights, const Emitter& emitter) {
    return lights.pmf(emitter.index, emitter.selection_pmf);
}

float next_event_pmf(const Vertex& v, const Emitter& emitter, const Guide* guide) {
    const LightSelection* lights = guide ? guide->lights_at(v.p, side_normal(v)) : nullptr;
    return lights ? learned_selection_pmf(*lights, emitter) : emitter.selection_pmf;
}

float guided_emission_pmf(const Guide& guide, const Emitter& emitter) {
    return guide.chooses_emitters() ? guide.emission_pmf(emitter.index) : emitter.selection_pmf;
}

float origin_pdf(const Guide* guide, const Emitter& emitter, Vec3 d, float unguided) {
    const GuideFit* fit = guide ? guide->at_infinity(emitter.index) : nullptr;
    if (!fit || !(unguided > 0)) return unguided;
    const float a = fit->share[0];
    return (1 - a) * unguided + a * fit->mixture.pdf({}, d);
}

const GuideCell* emission_cell(const Guide* guide, const Emitter& emitter, Vec3 p) {
    if (!guide || guide->emission.is_empty() || emitter.is_infinite()) return nullptr;
    const GuideCell& cell = guide->emission.cell(p);
    return cell.field(TransportMode::Importance).share[0] > 0 ? &cell : nullptr;
}

float emission_pdf(const Guide* guide, const Emitter& emitter, Vec3 p, Vec3 ng, Vec3 w,
                   float unguided) {
    const GuideCell* cell = emission_cell(guide, emitter, p);
    if (!cell || !(unguided > 0)) return unguided;
    const GuideCell::Field& field = cell->field(TransportMode::Importance);
    const float a = field.share[0];
    return (1 - a) * unguided + a * field.mixture.pdf(emission_view(emitter, *cell, p, ng), w);
}

}  // namespace etendue
