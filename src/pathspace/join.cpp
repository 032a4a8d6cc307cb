#include "pathspace/join.h"

#include <algorithm>
#include <array>

#include "guide/light_selection.h"
#include "math/in_place.h"
#include "math/rotated.h"

namespace etendue {

static_assert(sizeof(Join) <= 120 && sizeof(TechniqueCounts) <= 80);

Rgb edge_attenuation(const Scene& scene, const Vertex& a, const Vertex& b, Vec3 a_to_b) {
    // If the two differ although no surface lies between them (an inconsistent scene), the choice does not depend on
    // the order of the vertices.
    const MediumId at_a = a.medium_toward(a_to_b), at_b = b.medium_toward(-a_to_b);
    const MediumId medium = scene.has_open_boundaries() ? at_b : std::min(at_a, at_b);
    if (a.is_infinite) return scene.attenuation_to_infinity(medium, b.ray_end(), a.p);
    return scene.attenuation(medium, b.ray_end(), a.ray_end());
}

float visibility(const Scene& scene, const Join& join, RenderStats& stats) {
    if (!join.needs_test) return 1;
    ++stats.shadow_rays;
    const float Tr = join.to_infinity ? scene.transmittance_to_infinity(join.a, join.b.p)
                                      : scene.transmittance(join.a, join.b);
    stats.visible += Tr > 0;
    return Tr;
}

std::optional<Join> join_hit(const SubPath& z, int t, const Emitter& emitter,
                             const TechniqueCounts& counts) {
    const int last = t - 1;
    const Vertex& v = z[last];
    if (!(counts.hit > 0)) return {};
    const EmitterHit e = v.is_infinite ? emitter.eval_infinite(v.p)
                                       : emitter.eval_surface(v.ng, v.uv, v.location.prim, v.wo);
    if (e.Le.is_zero()) return {};

    // From the split before x_0 outward: next event has its own density of x_0, all others have the emission's.
    const double p_L = counts.uses_light_paths()
                           ? double(emission_pmf(counts.guide, emitter)) *
                                 origin_pdf(counts.guide, emitter, v.p, e.pdf_y0) / v.pdf_fwd
                           : 0.0;
    double others = 0;
    if (const Vertex& prev = z[last - 1]; last >= 2 && !prev.is_delta) {
        const double p_NE = next_event_pdf(prev, v, emitter, e) / v.pdf_fwd;
        others += sqr(counts.next_events(prev.is_fixed_by_film) * p_NE) +
                  sqr(counts.connect_emission * counts.reaching(prev.is_fixed_by_film) * p_L);
    }
    if (counts.uses_light_paths()) {
        const double rev_prev =
            v.is_infinite
                ? to_area(e.pdf_d, v, z[last - 1])
                : emission_pdf(counts.guide, emitter, v.p, v.ng, v.wo, e.pdf_d) * v.to_predecessor;
        double inner = squares_at<Side::Eye>(z, last - 1, z[last - 1].is_delta, rev_prev,
                                             gloss_of_emitter(emitter.is_area()), last, counts) +
                       z[last].weight_sum;
        inner *= sqr(rev_prev / z[last - 1].pdf_fwd);
        others += sqr(p_L) * inner;
    }
    return optional_of([&] {
        return Join{.technique = connection_technique(0, t),
                    .emitter = &emitter,
                    .contribution = v.beta * e.Le,
                    .mis_weight =
                        power_heuristic(counts.hit * counts.reaching(v.is_fixed_by_film), others),
                    .film = z.film,
                    .needs_test = false};
    });
}

namespace {

/// The emitter of a next event at z_last, and the numbers for its point.
struct EmitterChoice {
    const Emitter* emitter;
    FinePoint u;
};
EmitterChoice choose_emitter(const Scene& scene, const SubPath& z, int last, Sampler& sampler,
                             uint32_t draw) {
    sampler.seek(Stream::Connection, uint32_t(last));
    const double u = rotated(sampler.next_1d_fine_if(scene.has_emitter_choice()), draw);
    const FinePoint of_point = rotated(sampler.next_2d_fine(), draw);
    return {&select_emitter(scene, z[last], u), of_point};
}

}  // namespace

const Emitter& select_emitter(const Scene& scene, const Vertex& v, double u) {
    if (!v.lights) return scene.sample_emitter(u);
    const LightSelection::Draw selected = v.lights->sample(u);
    return selected.emitter ? scene.emitter(*selected.emitter) : scene.sample_emitter(selected.u);
}

void prefetch_next_events(const Scene& scene, std::span<const WalkInTurn> walks) {
    if (!scene.has_large_emitter_tables() || !scene.has_emitters()) return;
    // Later ones would displace those of the first vertices before they are read.
    constexpr size_t kMostVertices = 8;
    struct Search {
        EmitterChoice chosen;
        int searched;
    };
    std::array<Search, kWalksInTurn * kMostVertices> searches;
    size_t count = 0;
    for (const WalkInTurn& w : walks)
        for (int i = 1; i < std::min(w.path->size(), int(kMostVertices)); ++i) {
            if (!(*w.path)[i].is_connectible) continue;
            Search& s = searches[count++];
            s.chosen = choose_emitter(scene, *w.path, i, *w.sampler, 0);
            s.searched = s.chosen.emitter->prefetch_search(s.chosen.u);
        }
    for (const Search& s : std::span(searches.data(), count))
        s.chosen.emitter->prefetch_result(s.chosen.u, s.searched);
}

std::optional<Join> join_next_event(const Scene& scene, const SubPath& z, int t, Sampler& sampler,
                                    const TechniqueCounts& counts, uint32_t draw) {
    const int last = t - 1;
    const Vertex& v = z[last];
    if (!v.is_connectible || !scene.has_emitters()) return {};
    const auto [chosen, u] = choose_emitter(scene, z, last, sampler, draw);
    const Emitter& emitter = *chosen;
    DirectSample d;
    if (!emitter.sample_direct(v.p, u, d)) return {};
    const BsdfEval f = v.eval(d.wi, TransportMode::Radiance);
    if (f.f.is_zero()) return {};

    // |cos θ_0| / d² of a surface, 1 / d² of a point, 1 at infinity.
    const bool infinite = emitter.is_infinite();
    const float inv_dist2 = infinite ? 1.0f : 1 / sqr(d.dist);
    const float to_x0 = emitter.is_area() ? abs_dot(d.ng, d.wi) * inv_dist2 : inv_dist2;
    const float p_NE = next_event_pmf(v, emitter) * d.pdf;
    Rgb C = v.beta * f.f * d.Le * (to_x0 / p_NE);
    const RayEnd x0 = emitter.is_area() ? RayEnd{d.p, d.ng, d.slack} : RayEnd{d.p};
    if (scene.has_media()) {
        const MediumId medium = v.medium_toward(d.wi);
        C *= infinite ? scene.attenuation_to_infinity(medium, v.ray_end(), d.wi)
                      : scene.attenuation(medium, v.ray_end(), x0);
    }

    double others = emitter.is_delta()
                        ? 0.0
                        : sqr(double(counts.hit * counts.reaching(false)) * f.pdf * to_x0 / p_NE);
    if (counts.uses_light_paths()) {
        const float pdf_d = emission_pdf(counts.guide, emitter, d.p, d.ng, -d.wi, d.pdf_d);
        const double rev_last = double(pdf_d) * abs_dot(v.ng, d.wi) * inv_dist2;
        const double rev_prev = f.pdf_rev * v.to_predecessor;
        const double p_L = double(emission_pmf(counts.guide, emitter)) *
                           origin_pdf(counts.guide, emitter, d.p, d.pdf_y0);
        others += sqr(p_L / p_NE) *
                  (sqr(double(counts.connect_emission * counts.reaching(v.is_fixed_by_film))) +
                   outward_sum<Side::Eye>(
                       z, last, false, {rev_last, rev_prev, gloss_of_emitter(emitter.is_area()), t},
                       counts));
    }
    return optional_of([&] {
        return Join{.technique = {Strategy::NextEvent, 1, t},
                    .emitter = &emitter,
                    .contribution = C,
                    .mis_weight = power_heuristic(counts.next_events(v.is_fixed_by_film), others),
                    .film = z.film,
                    .a = v.ray_end(),
                    .b = x0,
                    .to_infinity = infinite};
    });
}

namespace {

/// The edge between y_{s-1} and z_{t-1}.
struct Edge {
    Vec3 w;            ///< From y_{s-1} to z_{t-1}.
    Rgb contribution;  ///< Of the connection, without visibility.
    /// Densities of y_{s-1} as sampled from z_{t-1}, and of z_{t-1} as sampled from y_{s-1}.
    double rev_a, rev_b;
    double total;  ///< Σ (n·p)² over all techniques, relative to p of this split.
};

/// y_{s-1} (which may be y_0, as the emission sampled it) connected to z_{t-1}, t ≥ 2.
std::optional<Edge> connect(const Scene& scene, const SubPath& y, int s, const SubPath& z, int t,
                            const TechniqueCounts& counts,
                            const EarlyRoulette* roulette = nullptr) {
    const Vertex& a = y[s - 1];
    const Vertex& b = z[t - 1];
    if (!a.is_connectible || !b.is_connectible) return {};
    const Vec3 d = a.is_infinite ? -a.p : b.p - a.p;
    const float dist2 = length2(d);
    if (!(dist2 > 0)) return {};
    const float inv_dist = 1 / std::sqrt(dist2), inv_dist2 = a.is_infinite ? 1.0f : sqr(inv_dist);
    Edge edge;
    edge.w = d * inv_dist;
    const BsdfEval fb = b.eval(-edge.w, TransportMode::Radiance);
    if (fb.f.is_zero()) return {};
    const BsdfEval fa = a.eval(edge.w, TransportMode::Importance);
    if (fa.f.is_zero()) return {};
    edge.contribution = a.beta * fa.f * fb.f * b.beta * inv_dist2;
    if (scene.has_media()) edge.contribution *= edge_attenuation(scene, a, b, edge.w);
    if (roulette && roulette->ends(edge.contribution)) return {};

    const double squares =
        s == 1 ? emission_squares(double(next_event_ratio(a, b, edge.w, counts.guide)),
                                  b.is_fixed_by_film, counts)
               : sqr(double(counts.connect * counts.reaching(b.is_fixed_by_film)));
    edge.rev_a = double(fb.pdf) * (a.has_cosine ? abs_dot(a.ng, edge.w) : 1.0f) * inv_dist2;
    edge.rev_b = double(fa.pdf) * abs_dot(b.ng, edge.w) * inv_dist2;
    if (a.is_infinite) edge.rev_a = fb.pdf;
    edge.total =
        squares +
        outward_sum<Side::Light>(
            y, s - 1, false,
            {edge.rev_a, s >= 2 ? fa.pdf_rev * a.to_predecessor : 0.0f, gloss(b, false), s + t - 1},
            counts) +
        outward_sum<Side::Eye>(
            z, t - 1, false,
            {edge.rev_b, fb.pdf_rev * b.to_predecessor, gloss(a, false), s + t - 1}, counts);
    return edge;
}

/// The join by the edge between `a` of y and `b` of z; `np` is relative to the density p of the split there.
Join joined(const Edge& edge, const Technique& technique, double np, const SubPath& y,
            const Vertex& a, const SubPath& z, const Vertex& b) {
    return {.technique = technique,
            .emitter = y[0].emitter,
            .contribution = edge.contribution,
            .mis_weight = float(sqr(np) / edge.total),
            .film = z.film,
            .a = b.ray_end(),
            .b = a.ray_end(),
            .to_infinity = a.is_infinite};
}

}  // namespace

std::optional<Join> join_connect(const Scene& scene, const SubPath& y, int s, const SubPath& z,
                                 int t, const TechniqueCounts& counts,
                                 const EarlyRoulette* roulette) {
    const auto edge = connect(scene, y, s, z, t, counts, roulette);
    if (!edge) return {};
    const Technique technique{Strategy::Connect, s, t};
    const Vertex &a = y[s - 1], &b = z[t - 1];
    const double np = double(counts.of(technique) * counts.reaching(b.is_fixed_by_film));
    return optional_of([&] { return joined(*edge, technique, np, y, a, z, b); });
}

std::optional<Join> join_gather(const Scene& scene, const SubPath& y, int s, const SubPath& z,
                                int t, bool drops_eye, const TechniqueCounts& counts) {
    if (!(counts.gathers(s + t - 2) > 0)) return {};
    const auto edge = connect(scene, y, drops_eye ? s : s - 1, z, drops_eye ? t - 1 : t, counts);
    if (!edge) return {};
    const Vertex &a = y[drops_eye ? s - 1 : s - 2], &b = z[drops_eye ? t - 2 : t - 1];
    const Vertex& x_m = drops_eye ? y[s - 1] : z[t - 1];
    const bool is_fixed_by_film = z[t - 1].is_fixed_by_film;
    const double probability =
        counts.pairs.probability(drops_eye ? edge->rev_a : edge->rev_b, is_fixed_by_film);
    const double count = counts.weighed_gathers(x_m.pair_level, is_fixed_by_film, s + t - 2);
    // A density that is too small for a float belongs to a contribution that is zero, too.
    const float pair_probability = float(probability);
    if (!(pair_probability > 0)) return {};
    return optional_of([&] {
        Join join =
            joined(*edge, {Strategy::Gather, s, t, drops_eye}, count * probability, y, a, z, b);
        join.pair_probability = pair_probability;
        return join;
    });
}

namespace {

/// Density estimate at b = z_{t-1}: the contribution of a photon's flux, spread over the area `disc`. `f` is the value
/// at b for the photon's direction `wi`; its cosine is already part of the flux.
Rgb density_estimate(Rgb power, Vec3 wi, const BsdfEval& f, const Vertex& b, float disc) {
    return power * f.f * b.beta * (1 / (abs_dot(wi, b.ng) * disc));
}

}  // namespace

std::optional<Join> join_merge(const SubPath& y, int s, const SubPath& z, int t,
                               const TechniqueCounts& counts) {
    const Vertex &a = y[s - 1], &b = z[t - 1];
    const int edges = s + t - 2;
    if (edges < counts.pairs.min_edges || s - 1 < counts.pairs.first_merge) return {};
    const BsdfEval f = b.eval(a.wo, TransportMode::Radiance);
    if (f.f.is_zero()) return {};
    // Relative to the split after x_m, which has p_L(x_m) but not p_E(x_m).
    const double total =
        split_squares<Side::Eye>(z, t - 1, false, 0, counts) +
        outward_sum<Side::Light>(y, s - 1, false,
                                 {b.pdf_fwd, f.pdf * a.to_predecessor,
                                  b.is_fixed_by_film ? kLensGloss : uint8_t(0), edges},
                                 counts) +
        sqr(f.pdf_rev * b.to_predecessor / z[t - 2].pdf_fwd) *
            (squares_at<Side::Eye>(z, t - 2, z[t - 2].is_delta, 0, 0, edges, counts) +
             b.weight_sum);
    const double np = counts.merge_area(a.pair_level, b.is_fixed_by_film) * double(b.pdf_fwd);
    const float disc = counts.pairs.disc_of(b.is_fixed_by_film);
    return optional_of([&] {
        return Join{.technique = {Strategy::Merge, s, t},
                    .emitter = y[0].emitter,
                    .contribution = density_estimate(a.beta, a.wo, f, b, disc),
                    .mis_weight = float(sqr(np) / total),
                    .film = z.film,
                    .needs_test = false};
    });
}

std::optional<Join> join_photon(const Photon& photon, const SubPath& z, int t, float disc) {
    const Vertex& b = z[t - 1];
    const BsdfEval f = b.eval(photon.wi, TransportMode::Radiance);
    if (f.f.is_zero()) return {};
    return optional_of([&] {
        return Join{.technique = {Strategy::Merge, photon.s, t},
                    .emitter = photon.emitter,
                    .contribution = density_estimate(photon.power, photon.wi, f, b, disc),
                    .mis_weight = 1,
                    .film = z.film,
                    .needs_test = false};
    });
}

namespace {

/// Whether y_{s-1} is y_0 of an emitter without extent, which is not seen directly.
bool is_invisible(const SubPath& y, int s) {
    return s == 1 && y[0].emitter->is_delta();
}

}  // namespace

std::optional<Join> join_splat(const Scene& scene, const SubPath& y, int s, Sampler& sampler,
                               const TechniqueCounts& counts) {
    const Vertex& a = y[s - 1];
    const Technique technique{Strategy::Splat, s, 1};
    const float count = counts.of(technique);
    if (!a.is_connectible || !(count > 0) || is_invisible(y, s)) return {};
    sampler.seek(Stream::Connection, uint64_t(s) + 0x8000u);
    const Sensor& sensor = scene.sensor();
    if (a.is_infinite && sensor.is_orthographic()) return {};
    const auto lens = sensor.sample_connection(a.p, a.is_infinite, sampler.next_2d());
    if (!lens) return {};
    const Vec3 edge = lens->p - a.p;
    // Toward the sensor. Neither an emitter nor a sensor at infinity has a distance in G.
    const bool no_distance = a.is_infinite || sensor.is_orthographic();
    const float inv_dist = no_distance ? 1.0f : 1 / length(edge);
    const Vec3 w = a.is_infinite ? -a.p : sensor.is_orthographic() ? -lens->ng : edge * inv_dist;
    const float inv_dist2 = sqr(inv_dist);

    const BsdfEval f = a.eval(w, TransportMode::Importance);
    if (f.f.is_zero()) return {};
    Rgb C = a.beta * f.f * (lens->We_cos / lens->pdf_pos * inv_dist2);
    if (scene.has_media())
        C *= a.is_infinite ? scene.attenuation_to_infinity(scene.sensor_medium(), {lens->p}, a.p)
                           : scene.attenuation(a.medium_toward(w), a.ray_end(), {lens->p});

    const double rev_last =
        a.is_infinite ? lens->pdf_dir
                      : lens->pdf_dir * (a.has_cosine ? abs_dot(a.ng, w) : 1.0f) * inv_dist2;
    const double rev_prev = s >= 2 ? f.pdf_rev * a.to_predecessor : 0.0f;
    double others =
        outward_sum<Side::Light>(y, s - 1, false, {rev_last, rev_prev, kLensGloss, s}, counts);
    if (counts.hit_lens > 0)
        others +=
            sqr(double(counts.hit_lens) * f.pdf * abs_dot(lens->ng, w) * inv_dist2 / lens->pdf_pos);
    return optional_of([&] {
        return Join{.technique = technique,
                    .emitter = y[0].emitter,
                    .contribution = C,
                    .mis_weight = power_heuristic(count, others),
                    .film = lens->film,
                    .a = {lens->p},
                    .b = a.ray_end(),
                    .to_infinity = a.is_infinite};
    });
}

std::optional<Join> join_hit_lens(const Scene& scene, const SubPath& y, int s,
                                  const TechniqueCounts& counts) {
    const Vertex& a = y[s - 1];
    const Flight& flight = y.flight;
    if (!(counts.hit_lens > 0) || !(flight.pdf_sa > 0) || is_invisible(y, s)) return {};
    const Vec3 origin = a.is_infinite ? flight.o : a.p;
    const auto lens = scene.sensor().hit_lens(origin, flight.d, flight.length);
    if (!lens) return {};
    const float dist2 = a.is_infinite ? 1.0f : length2(lens->p - origin);
    const float cos_lens = abs_dot(lens->ng, flight.d);
    const Rgb C = flight.beta * (lens->We_cos / cos_lens) *
                  scene.attenuation(flight.medium, {origin}, {lens->p});

    const double p_fwd = double(flight.pdf_sa) * double(cos_lens / dist2);
    const double p_lens = lens->pdf_pos / p_fwd;
    const double rev_last = lens->pdf_dir * (a.has_cosine ? abs_dot(a.ng, flight.d) : 1.0f) / dist2;
    double others =
        sqr(p_lens) * outward_sum<Side::Light>(
                          y, s - 1, a.is_delta,
                          {rev_last, s >= 2 ? y[s - 2].pdf_rev : 0.0f, kLensGloss, s}, counts);
    if (!a.is_delta) others += sqr(counts.of(connection_technique(s, 1)) * p_lens);
    return optional_of([&] {
        return Join{.technique = {Strategy::HitLens, s + 1, 0},
                    .emitter = y[0].emitter,
                    .contribution = C,
                    .mis_weight = power_heuristic(counts.hit_lens, others),
                    .film = lens->film,
                    .a = {origin},
                    .b = {lens->p},
                    .to_infinity = a.is_infinite,
                    .needs_test = false};
    });
}

}  // namespace etendue
