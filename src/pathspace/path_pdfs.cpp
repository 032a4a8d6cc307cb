#include "pathspace/path_pdfs.h"

#include <cmath>

#include "guide/guide.h"
#include "pathspace/mis.h"

namespace etendue {
namespace {

double inverse_square(const Vertex& a, const Vertex& b) {
    return a.is_infinite || b.is_infinite ? 1.0 : 1.0 / double(length2(b.p - a.p));
}

}  // namespace

double PathPdfs::density(const Technique& q) const {
    const int n = vertices();
    if (q.vertices() != n) return 0;
    if (q.s > 0 && is_delta[q.s - 1] && q.t > 0) return 0;
    if (q.s < n && is_delta[q.s] && q.s > 0) return 0;
    if (q.strategy == Strategy::Hit && !can_hit_emitter) return 0;
    if (q.s == 1 && q.t == 1 && !can_connect_ends) return 0;
    double p = 1;
    for (int i = 0; i < q.s; ++i)
        p *= q.strategy == Strategy::NextEvent && i == 0 ? next_event : light[i];
    for (int i = q.s; i < n; ++i) p *= eye[i];
    return p;
}

double PathPdfs::sampled(const Technique& q, const TechniqueCounts& counts) const {
    const int k = vertices() - 1, m = q.s - 1;
    const double n = counts.of(q);
    if (!(n > 0)) return 0;
    if (q.strategy == Strategy::NextEvent)
        return counts.next_events(is_fixed_by_film[1]) * density(q);
    if (!is_pair(q.strategy))
        return n * density(q) * (q.t >= 2 ? counts.reaching(is_fixed_by_film[size_t(q.s)]) : 1);
    if (m < 1 || m >= k || k < counts.pairs.min_edges || is_delta[m]) return 0;
    double others = 1;  // of all vertices but x_m
    for (int i = 0; i < m; ++i) others *= light[i];
    for (int i = m + 1; i <= k; ++i) others *= eye[i];
    if (q.strategy == Strategy::Merge)
        return m < counts.pairs.first_merge
                   ? 0
                   : counts.merge_area(pair_level[m], is_fixed_by_film[m]) * others * light[m] *
                         eye[m];
    if (!drops(counts.pairs.rule, q.drops_eye, gloss[m - 1], gloss[m + 1])) return 0;
    const double kept = q.drops_eye ? light[m] : eye[m], dropped = q.drops_eye ? eye[m] : light[m];
    return counts.weighed_gathers(pair_level[m], is_fixed_by_film[m], k) * others * kept *
           counts.pairs.probability(dropped, is_fixed_by_film[m]);
}

double mis_weight(const PathPdfs& pdfs, const Technique& technique, const TechniqueCounts& counts) {
    const double specular = pdfs.specular_weight();
    if (technique.strategy == Strategy::Specular) return specular;
    double sum = 0;
    const auto add = [&](const Technique& q) { sum += sqr(pdfs.sampled(q, counts)); };
    const int n = pdfs.vertices();
    for (int s = 0; s <= n; ++s) {
        add(connection_technique(s, n - s));
        if (s == 1 && n > 2) add({Strategy::Connect, 1, n - 1});
        if (s == 0) continue;
        add({Strategy::Merge, s, n + 1 - s});
        for (const bool drops_eye : {false, true}) add({Strategy::Gather, s, n + 1 - s, drops_eye});
    }
    return sqr(pdfs.sampled(technique, counts)) / sum * (1 - specular);
}

std::vector<const Vertex*> path_vertices(const SubPath& y, int s, const SubPath& z, int t,
                                         const Vertex* emitter_point, const Vertex* lens_point) {
    std::vector<const Vertex*> x;
    for (int i = 0; i < s; ++i) x.push_back(i == 0 && emitter_point ? emitter_point : &y[i]);
    for (int i = t - 1; i >= 0; --i) x.push_back(i == 0 && lens_point ? lens_point : &z[i]);
    return x;
}

Vertex emitter_end(const Join& join, const Vertex& next) {
    Vertex x0;
    x0.kind = Vertex::Kind::Emitter;
    x0.emitter = join.emitter;
    x0.p = join.b.p;
    x0.ng = join.b.ng;
    x0.is_infinite = join.to_infinity;
    x0.has_cosine = join.emitter->is_area();
    if (!x0.has_cosine) x0.ng = x0.is_infinite ? -x0.p : normalize(next.p - x0.p);
    return x0;
}

Vertex lens_end(const Scene& scene, const Join& join) {
    Vertex lens;
    lens.kind = Vertex::Kind::Sensor;
    lens.is_infinite = scene.sensor().is_orthographic();
    const SensorRay ray = scene.sensor().sample_ray(join.film, {0.5f, 0.5f});
    lens.ng = ray.ng;
    lens.p = lens.is_infinite ? -ray.ng : join.a.p;
    lens.pdf_fwd = ray.pdf_pos;
    return lens;
}

PathValue evaluate_path(const Scene& scene, std::span<const Vertex* const> x,
                        const std::vector<bool>& delta, const Guide* guide) {
    const int n = int(x.size()), k = n - 1;
    PathValue v;
    PathPdfs& p = v.pdfs;
    p.light.assign(size_t(n), 1);
    p.eye.assign(size_t(n), 1);
    p.is_delta = delta;
    for (int i = 0; i < n; ++i) p.pair_level.push_back(x[size_t(i)]->pair_level);
    p.is_fixed_by_film.assign(size_t(n), false);
    for (int i = k - 1; i >= 0; --i)
        p.is_fixed_by_film[i] = i == k - 1 || (p.is_fixed_by_film[i + 1] && delta[size_t(i) + 1] &&
                                               !scene.sensor().has_finite_lens());
    for (int i = 0; i < n; ++i)
        p.gloss.push_back(i == 0 ? gloss_of_emitter(x[0]->emitter->is_area())
                                 : gloss(*x[i], delta[size_t(i)]));

    // Emission: x_0 and the direction to x_1.
    const Emitter& emitter = *x[0]->emitter;
    const Vec3 w0 = direction(*x[0], *x[1]);
    const Emitter::Emission emission =
        emitter.eval_emission(x[0]->ng, x[0]->uv, x[0]->location.prim, w0);
    const EmitterHit hit = emitter.is_infinite()
                               ? emitter.eval_infinite(x[0]->p)
                               : emitter.eval_surface(x[0]->ng, x[0]->uv, x[0]->location.prim, w0);
    p.can_hit_emitter = !emitter.is_delta();
    p.can_connect_ends = p.can_hit_emitter && !(x[0]->is_infinite && x[k]->is_infinite);
    p.light[0] = emission_pmf(guide, emitter);
    p.next_event = x[1]->kind == Vertex::Kind::Surface ? next_event_pmf(*x[1], emitter, guide)
                                                       : emitter.selection_pmf;
    if (p.can_hit_emitter) {
        p.light[0] *= origin_pdf(guide, emitter, x[0]->p, hit.pdf_y0);
        p.next_event *= emitter.is_infinite()
                            ? hit.pdf
                            : emitter.direct_pdf(x[0]->p, x[0]->ng, x[0]->location.prim, x[1]->p);
    }
    p.light[1] =
        to_area(emission_pdf(guide, emitter, x[0]->p, x[0]->ng, w0, emission.pdf_d), *x[0], *x[1]);
    v.f = emission.Le_cos;

    // Sensor: x_k and the direction to x_{k-1}.
    const Sensor& sensor = scene.sensor();
    const Vec3 wk = direction(*x[k], *x[k - 1]);
    const float pdf_dir = sensor.pdf_direction(x[k]->p, wk);
    p.eye[k] = x[k]->pdf_fwd;
    p.eye[k - 1] = to_area(pdf_dir, *x[k], *x[k - 1]);
    v.f *= pdf_dir * x[k]->pdf_fwd;  // W_e |cos θ|

    for (int i = 1; i < k; ++i) {
        const Vec3 to_light = direction(*x[i], *x[i - 1]), to_eye = direction(*x[i], *x[i + 1]);
        Rgb f;
        float pdf_light = 0, pdf_eye = 0;  // in solid angle
        if (delta[i]) {
            const auto event =
                x[i]->bsdf.sample_delta(to_light, x[i]->event, TransportMode::Importance);
            if (event) {
                f = event->weight * event->pdf;
                pdf_light = event->pdf, pdf_eye = event->pdf_rev;
            }
        } else {
            const BsdfEval e = x[i]->bsdf.eval(to_light, to_eye, TransportMode::Importance);
            f = e.f;
            pdf_light = e.pdf;
            pdf_eye = x[i]->bsdf.eval(to_eye, to_light, TransportMode::Radiance).pdf;
            if (guide && guide->guides_surfaces()) {
                const GuideCell& cell = guide->surfaces.cell(x[i]->p);
                pdf_light =
                    guided_pdf(*x[i], cell, to_light, to_eye, TransportMode::Importance, pdf_light);
                pdf_eye =
                    guided_pdf(*x[i], cell, to_eye, to_light, TransportMode::Radiance, pdf_eye);
            }
        }
        p.light[i + 1] = to_area(pdf_light, *x[i], *x[i + 1]);
        p.eye[i - 1] = to_area(pdf_eye, *x[i], *x[i - 1]);
        // f̃·|cos| toward the eye; the other cosines follow as the loop goes on: each edge is G = |cos||cos| / d².
        v.f *= f * float(inverse_square(*x[i - 1], *x[i]) * abs_dot(x[i]->ng, to_light));
    }
    v.f *= float(inverse_square(*x[k - 1], *x[k]));
    return v;
}

}  // namespace etendue
