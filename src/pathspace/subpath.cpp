#include "pathspace/subpath.h"

#include <algorithm>

namespace etendue {
namespace {

/// Survival of Russian roulette at the last vertex: how much throughput is left of what it was at the first scattering
/// vertex. η² of refractions is taken out, since it comes back when the path leaves the glass.
Survival survival(const SubPath& path) {
    const float left = path[path.size() - 1].beta.max() * path.eta2 / path[1].beta.max();
    return Survival(left > 0 ? std::min(0.95f, left) : 0x1p-16f);
}

/// Traces from the last vertex along `d` and appends what is found, with throughput `beta` and density `pdf_sa` of the
/// direction (discrete for a delta event). False where the ray leaves the scene.
bool append_surface(const Scene& scene, Sampler& sampler, SubPath& path, const Ray& ray, Rgb beta,
                    float pdf_sa, bool is_delta, MediumId medium, const TechniqueCounts& counts,
                    RenderStats& stats) {
    ++stats.walk_rays;
    SurfaceHit hit;
    const float u = scene.has_masks() ? sampler.next_1d() : 0.0f;
    path.flight = {ray.o, ray.d, kInf, beta, pdf_sa, medium};
    if (!scene.intersect(ray, u, hit)) return false;
    path.flight.length = hit.t;
    ++stats.vertices;
    Vertex& v = path.append();
    v.set_surface(*hit.shape, hit.location, hit.geometry, -ray.d, path.arena);
    v.medium = medium;
    v.pair_level = counts.pair_level(v.p);
    v.beta = medium == kVacuum ? beta : beta * scene.attenuation(medium, hit.t);
    // hit.t is short of the distance by the offset of the ray's origin; densities are of the points themselves.
    const Vertex& previous = path[path.size() - 2];
    const float inv_dist2 = previous.is_infinite ? 1.0f : 1 / length2(v.p - previous.p);
    v.pdf_fwd = is_delta ? pdf_sa : pdf_sa * (abs_dot(v.ng, ray.d) * inv_dist2);
    v.to_predecessor = previous.has_cosine && !previous.is_infinite
                           ? abs_dot(previous.ng, ray.d) * inv_dist2
                           : inv_dist2;
    return v.pdf_fwd > 0;
}

/// The end of an eye path that left the scene: a vertex at infinity, on all emitters there at once.
void append_escape(SubPath& path, Vec3 d, Rgb beta, float pdf) {
    Vertex& v = path.append();
    v.kind = Vertex::Kind::Emitter;
    v.is_infinite = true;
    v.p = d;
    v.ng = -d;
    v.wo = -d;
    v.beta = beta;
    v.pdf_fwd = pdf;
}

template <Side side>
void store_weight_sum(SubPath& path, const TechniqueCounts& counts) {
    const int last = path.size() - 1;
    if (last < 2) return;
    // Level last-2 became known with this vertex; the levels below it were stored at its predecessor.
    path[last].weight_sum = level_sum<side>(path, last - 2, path[last - 1].weight_sum, counts);
}

}  // namespace

float next_event_ratio(const Vertex& y0, Vec3 w) {
    const EmitterHit e = y0.is_infinite
                             ? y0.emitter->eval_infinite(y0.p)
                             : y0.emitter->eval_surface(y0.ng, y0.uv, y0.location.prim, w);
    return e.pdf_y0 > 0 ? e.pdf / e.pdf_y0 : 1.0f;
}

RenderStats& RenderStats::operator+=(const RenderStats& o) {
    phases += o.phases;
    eye_paths += o.eye_paths;
    light_paths += o.light_paths;
    vertices += o.vertices;
    walk_rays += o.walk_rays;
    shadow_rays += o.shadow_rays;
    visible += o.visible;
    joins_skipped += o.joins_skipped;
    pairs += o.pairs;
    visible_pairs += o.visible_pairs;
    trials += o.trials;
    trial_rays += o.trial_rays;
    for (size_t i = 0; i < pairs_by_trials.size(); ++i) pairs_by_trials[i] += o.pairs_by_trials[i];
    for (size_t i = 0; i < second_moments.size(); ++i) second_moments[i] += o.second_moments[i];
    for (size_t i = 0; i < pair_joins.size(); ++i) {
        pair_joins[i].count += o.pair_joins[i].count;
        pair_joins[i].squares += o.pair_joins[i].squares;
    }
    bounds_exceeded += o.bounds_exceeded;
    runaways += o.runaways;
    rejected += o.rejected;
    return *this;
}

void start_eye_path(const Scene& scene, const Film& film, uint64_t pixel, Sampler& sampler,
                    const TechniqueCounts& counts, SubPath& z, RenderStats& stats) {
    ++stats.eye_paths;
    z.clear();
    sampler.seek(Stream::Eye, 0);
    const Film::PixelSample pixel_sample = film.sample_pixel(pixel, sampler.next_2d());
    z.film = pixel_sample.point;
    z.film_weight = pixel_sample.weight;
    const SensorRay ray = scene.sensor().sample_ray(z.film, sampler.next_2d());

    Vertex& lens = z.append();
    lens.kind = Vertex::Kind::Sensor;
    lens.ng = ray.ng;
    lens.pdf_fwd = ray.pdf_pos;
    lens.beta = Rgb(1 / ray.pdf_pos);
    lens.may_connect = true;
    lens.is_infinite = scene.sensor().is_orthographic();
    lens.p = lens.is_infinite ? -ray.d : ray.p;

    const Ray start{ray.p, ray.d, kInf};
    if (append_surface(scene, sampler, z, start, Rgb(1), ray.pdf_dir, false, kVacuum, counts,
                       stats))
        return;
    z.truncate(1);
    if (!scene.infinite_emitters().empty()) append_escape(z, ray.d, Rgb(1), ray.pdf_dir);
}

bool start_light_path(const Scene& scene, Sampler& sampler, const TechniqueCounts& counts,
                      SubPath& y, RenderStats& stats) {
    y.clear();
    if (!scene.has_emitters()) return false;
    ++stats.light_paths;
    sampler.seek(Stream::Light, 0);
    const Emitter& emitter = scene.sample_emitter(sampler.next_1d_if(scene.has_emitter_choice()));
    const Vec2 u_y0 = sampler.next_2d();
    const EmissionSample e = emitter.sample_emission(u_y0, sampler.next_2d());
    y.u_emission = u_y0;
    if (!(e.pdf_y0 > 0)) return false;

    Vertex& y0 = y.append();
    y0.kind = Vertex::Kind::Emitter;
    y0.emitter = &emitter;
    y0.is_infinite = emitter.is_infinite();
    y0.has_cosine = emitter.is_area();
    y0.p = y0.is_infinite ? -e.d : e.p;
    y0.ng = e.ng;
    y0.uv = e.uv;
    y0.location.prim = e.prim;
    y0.may_connect = true;
    y0.gloss = gloss_of_emitter(emitter.is_area());
    y0.pdf_fwd = emitter.selection_pmf * e.pdf_y0;
    y0.beta = Rgb(1 / y0.pdf_fwd);

    if (!(e.pdf_d > 0)) return true;
    const Vec3 origin = y0.has_cosine ? offset_origin(e.p, e.ng, e.d) : e.p;
    const float cosine = y0.has_cosine ? abs_dot(e.ng, e.d) : 1.0f;
    const Rgb beta = e.Le * (cosine / (y0.pdf_fwd * e.pdf_d));
    if (!append_surface(scene, sampler, y, {origin, e.d, kInf}, beta, e.pdf_d, false, kVacuum,
                        counts, stats)) {
        y.truncate(1);
        return true;
    }
    Vertex& y1 = y[1];
    y1.next_event_ratio = next_event_ratio(y0, e.d);
    return true;
}

template <TransportMode mode>
bool extend(const Scene& scene, Sampler& sampler, const WalkOptions& options,
            const TechniqueCounts& counts, SubPath& path, RenderStats& stats) {
    constexpr bool eye = mode == TransportMode::Radiance;
    const int last = path.size() - 1;
    path.flight.pdf_sa = 0;
    if (last + 1 >= options.max_vertices) return false;
    sampler.seek(eye ? Stream::Eye : Stream::Light, uint32_t(last));
    Vertex& v = path[last];
    if (v.kind != Vertex::Kind::Surface) return false;
    const float u_lobe = sampler.next_1d_if(v.bsdf.uses_lobe_choice());
    const Vec2 u_direction = sampler.next_2d();
    float q = 1;
    if (last >= options.rr_depth) {
        v.survival = survival(path);
        q = v.survival.value();
        if (!(sampler.next_1d() < q)) return false;
    }
    const auto s = v.bsdf.sample(v.wo, u_lobe, u_direction, mode);
    if (!s) return false;
    v.is_delta = s->is_delta;
    Vertex& previous = path[last - 1];
    previous.pdf_rev = s->is_delta ? s->pdf_rev : s->pdf_rev * v.to_predecessor;
    if (eye) path.eta2 *= sqr(s->eta);

    const Rgb beta = v.beta * s->weight * (1 / q);
    const MediumId medium = v.medium_toward(s->wi);
    const Ray ray{offset_origin(v.p, v.ng, s->wi), s->wi, kInf};
    const bool found =
        append_surface(scene, sampler, path, ray, beta, s->pdf, s->is_delta, medium, counts, stats);
    if (!found) {
        path.truncate(last + 1);
        if (!eye || scene.infinite_emitters().empty()) return false;
        append_escape(path, s->wi, beta, s->pdf);
    }
    store_weight_sum<eye ? Side::Eye : Side::Light>(path, counts);
    return true;
}

bool look_along(const Scene& scene, Sampler& sampler, Vec3 wi, Rgb beta, SubPath& z,
                RenderStats& stats) {
    const int last = z.size() - 1;
    sampler.seek(Stream::Eye, uint32_t(last));
    Vertex& v = z[last];
    v.is_delta = false;
    const Ray ray{offset_origin(v.p, v.ng, wi), wi, kInf};
    if (append_surface(scene, sampler, z, ray, beta, 1, false, v.medium_toward(wi), {}, stats))
        return true;
    z.truncate(last + 1);
    return false;
}

template bool extend<TransportMode::Radiance>(const Scene&, Sampler&, const WalkOptions&,
                                              const TechniqueCounts&, SubPath&, RenderStats&);
template bool extend<TransportMode::Importance>(const Scene&, Sampler&, const WalkOptions&,
                                                const TechniqueCounts&, SubPath&, RenderStats&);

}  // namespace etendue
