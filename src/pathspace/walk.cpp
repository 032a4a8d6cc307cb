#include "pathspace/walk.h"

#include <algorithm>
#include <array>
#include <functional>

#include "guide/guide.h"

namespace etendue {
namespace {

/// Whether no vertex between the first and the last one is connectible.
bool is_first_connectible(const SubPath& path) {
    for (int i = 1; i + 1 < path.size(); ++i)
        if (path[i].is_connectible) return false;
    return true;
}

/// Survival of adjoint-driven Russian roulette at the last vertex: the expected contribution of the rest of the walk,
/// relative to that of the whole walk [Vorba & Křivánek 2016, §4]. For an eye walk the latter is the light that its first
/// connectible vertex reflects, for a light walk the mean of all. Walks are not split. Empty where either one is unknown,
/// and at surfaces too glossy for a mean over the directions of arrival. It depends on the walk up to this vertex alone,
/// like the rule below; the weights know of neither.
template <TransportMode mode>
std::optional<float> adjoint_survival(const WalkContext& walk, SubPath& path) {
    // With the window of Vorba & Křivánek, whose bounds have the ratio 5, roulette starts at a third of its centre.
    constexpr float kFactor = 3;
    constexpr float kLeast = 0.1f;  // where the estimate may be far too small
    const Guide* guide = walk.counts.guide;
    const Vertex& v = path[path.size() - 1];
    if (!path.cell || !guide->has_roulette || !v.is_connectible) return {};
    const WalkContribution expected = expected_contribution(v, *path.cell, mode);
    if (!(expected.beyond >= 0)) return {};
    const float beta = luminance(v.beta);
    float reference = guide->light_contribution;
    if constexpr (mode == TransportMode::Radiance) {
        if (is_first_connectible(path)) path.expected = beta * expected.here;
        reference = path.expected;
    }
    if (!(reference > 0) || guide_class(v.gloss) == kGuideClasses - 1) return {};
    const float q = kFactor * beta * expected.beyond / reference;
    if (!std::isfinite(q)) return {};
    return clamp(q, kLeast, 1.0f);
}

/// Survival of Russian roulette at the last vertex: its throughput relative to that of the first scattering vertex. The
/// η² of refractions is removed, since it cancels when the path leaves the glass. The throughput is that of a walk
/// without guide, because a good guide makes the throughput of the paths that it prefers small.
float throughput_survival(const SubPath& path) {
    const float left =
        path[path.size() - 1].beta.max() * path.eta2 * path.gain / path[1].beta.max();
    return left > 0 ? left : 0x1p-16f;
}

/// Survival of Russian roulette at the last vertex; empty where there is none. From rr_depth on, no walk is safe.
template <TransportMode mode>
std::optional<Survival> survival(const WalkContext& walk, SubPath& path) {
    constexpr float kMost = 0.95f;
    if (!walk.options.has_roulette) return {};
    const bool is_late = path.size() - 1 >= walk.options.rr_depth;
    const std::optional<float> adjoint = adjoint_survival<mode>(walk, path);
    if (!is_late) return adjoint ? std::optional(Survival(*adjoint)) : std::nullopt;
    return Survival(std::min(kMost, adjoint ? *adjoint : throughput_survival(path)));
}

/// Vertex::is_fixed_by_film of the vertex that follows `v`.
bool next_is_fixed_by_film(const Vertex& v, bool is_delta, const Scene& scene) {
    return v.kind == Vertex::Kind::Sensor ||
           (v.is_fixed_by_film && is_delta && !scene.sensor().has_finite_lens());
}

/// Traces the ray of the step, which leaves the last vertex.
void trace(const WalkContext& walk, Sampler& sampler, SubPath& path, Step& step) {
    const Scene& scene = walk.scene;
    ++walk.stats.walk_rays;
    std::function<float()> number;
    if (scene.has_masks()) {
        // The last number of its block. A chain in primary sample space keeps it for all rays.
        std::optional<float> known;
        if (sampler.kind() == SamplerKind::PrimarySample) known = sampler.next_1d();
        number = [&sampler, known] { return known ? *known : sampler.next_1d(); };
    }
    Passage passage{step.medium};
    step.found = scene.find(step.ray, number, step.hit, passage);
    Flight& flight = path.flight;  // by member: a vector copy stalls on stores of members
    flight.o = step.ray.o;
    flight.d = step.ray.d;
    flight.length = step.found ? step.hit.t : kInf;
    flight.beta = step.beta;
    flight.pdf_sa = step.pdf_sa;
    flight.medium = step.medium;
    step.beta *= passage.attenuation;
    step.medium = passage.medium;
}

/// Appends the surface vertex where the ray of the step ends; false where it hits the surface edge-on.
bool append_surface(const WalkContext& walk, SubPath& path, TransportMode mode, const Step& step) {
    const Ray& ray = step.ray;
    const SurfaceHit& hit = step.hit;
    ++walk.stats.vertices;
    Vertex& v = path.append();
    v.set_surface(*hit.shape, hit.location, hit.geometry, -ray.d, path.arena);
    v.medium = step.medium;
    if (const Guide* guide = walk.counts.guide) {
        if (guide->has_cells()) {
            path.cell = &guide->surfaces.cell(v.p);
            if (guide->guides_surfaces())
                v.set_guide(*path.cell, mode, walk.counts.uses_light_paths());
        }
        // Next events are made at eye vertices, and weighed at y_1.
        if (v.is_connectible && (mode == TransportMode::Radiance || path.size() == 2))
            v.lights = guide->lights_at(v.p, side_normal(v));
    }
    v.pair_level = walk.learned ? walk.learned->pair_level(v.p) : uint8_t(0);
    v.beta = step.beta;
    // hit.t is the distance from the offset origin of the ray; densities need the distance between the vertices.
    const Vertex& previous = path[path.size() - 2];
    v.is_fixed_by_film = next_is_fixed_by_film(previous, previous.is_delta, walk.scene);
    const float inv_dist2 = previous.is_infinite ? 1.0f : 1 / length2(v.p - previous.p);
    v.pdf_fwd = step.pdf_sa * (abs_dot(v.ng, ray.d) * inv_dist2);
    v.to_predecessor = previous.has_cosine && !previous.is_infinite
                           ? abs_dot(previous.ng, ray.d) * inv_dist2
                           : inv_dist2;
    if (v.pdf_fwd > 0) return true;
    path.truncate(path.size() - 1);
    return false;
}

/// Appends the vertex at infinity of an eye path that left the scene; it belongs to all emitters at infinity.
void append_escape(const Scene& scene, SubPath& path, const Step& step) {
    Vertex& v = path.append();
    const Vertex& previous = path[path.size() - 2];
    v.is_fixed_by_film = next_is_fixed_by_film(previous, previous.is_delta, scene);
    v.kind = Vertex::Kind::Emitter;
    v.is_infinite = true;
    v.p = step.ray.d;
    v.ng = -step.ray.d;
    v.wo = -step.ray.d;
    v.beta = step.beta;
    v.pdf_fwd = step.pdf_sa;
}

/// Appends the vertex where the ray of the step ends; false where there is none.
bool append_end(const WalkContext& walk, SubPath& path, TransportMode mode, Step& step) {
    if (step.found) {
        walk.scene.complete(step.hit);
        return append_surface(walk, path, mode, step);
    }
    if (mode == TransportMode::Importance || walk.scene.infinite_emitters().empty()) return false;
    append_escape(walk.scene, path, step);
    return true;
}

}  // namespace

float next_event_ratio(const Vertex& y0, const Vertex& next, Vec3 w, const Guide* guide) {
    const EmitterHit e = y0.is_infinite
                             ? y0.emitter->eval_infinite(y0.p)
                             : y0.emitter->eval_surface(y0.ng, y0.uv, y0.location.prim, w);
    const float by_light = emission_pmf(guide, *y0.emitter),
                pdf_y0 = origin_pdf(guide, *y0.emitter, y0.p, e.pdf_y0);
    return pdf_y0 > 0 ? float(next_event_pdf(next, y0, *y0.emitter, e) / double(by_light * pdf_y0))
                      : next_event_pmf(next, *y0.emitter) / by_light;
}

void start_eye_path(const WalkContext& walk, const Film& film, uint64_t index, Sampler& sampler,
                    SubPath& z) {
    sampler.seek(Stream::Eye, 0);
    const Film::PixelSample at = film.sample_pixel(index, sampler.next_2d_if(!film.spreads()));
    const Vec2 u_lens = sampler.next_2d_if(walk.scene.sensor().has_finite_lens());
    start_eye_path(walk, at, u_lens, sampler, z);
}

void start_eye_path_of_pixel(const WalkContext& walk, const Film& film, uint64_t pixel,
                             Sampler& sampler, SubPath& z) {
    sampler.seek(Stream::Eye, 0);
    const Film::PixelSample at = film.sample_alone(pixel, sampler.next_2d());
    const Vec2 u_lens = sampler.next_2d_if(walk.scene.sensor().has_finite_lens());
    start_eye_path(walk, at, u_lens, sampler, z);
}

void start_eye_path(const WalkContext& walk, const Film::PixelSample& at, Vec2 u_lens,
                    Sampler& sampler, SubPath& z) {
    start_eye_path(walk, at, walk.scene.sensor().sample_ray(at.point, u_lens), sampler, z);
}

void begin_eye_path(const WalkContext& walk, const Film::PixelSample& at, const SensorRay& ray,
                    Sampler& sampler, SubPath& z, Step& step) {
    ++walk.stats.eye_paths;
    z.clear();
    z.film = at.point;
    z.film_weight = at.weight;

    Vertex& lens = z.append();
    lens.kind = Vertex::Kind::Sensor;
    lens.ng = ray.ng;
    lens.pdf_fwd = ray.pdf_pos;
    lens.beta = Rgb(1 / ray.pdf_pos);
    lens.is_connectible = true;
    lens.is_infinite = walk.scene.sensor().is_orthographic();
    lens.p = lens.is_infinite ? -ray.d : ray.p;

    step.ray = {ray.p, ray.d, kInf};
    step.beta = Rgb(1);
    step.pdf_sa = ray.pdf_dir;
    step.medium = walk.scene.sensor_medium();
    trace(walk, sampler, z, step);
}

void start_eye_path(const WalkContext& walk, const Film::PixelSample& at, const SensorRay& ray,
                    Sampler& sampler, SubPath& z) {
    Step step;
    begin_eye_path(walk, at, ray, sampler, z, step);
    append_end(walk, z, TransportMode::Radiance, step);
}

namespace {

/// Replaces the direction of emission by one of the guide or the emitter. Its density is 0 if there is none.
void guide_emission(Vertex& y0, Vec2 u_d, float u_guide, EmissionSample& e) {
    const auto s = y0.sample(0, u_d, u_guide, TransportMode::Importance);
    e.pdf_d = s ? s->pdf : 0;
    if (!s) return;
    e.d = s->wi;
    if (!y0.has_cosine) y0.ng = e.d;
    e.Le = y0.emitter->eval_emission(y0.ng, y0.uv, y0.location.prim, e.d).Le_cos;
    if (y0.has_cosine) e.Le *= 1 / abs_dot(y0.ng, e.d);
}

/// Replaces y_0 at infinity by one of the guide or the emitter. Its density is 0 if there is none.
void guide_origin(const Guide& guide, const GuideFit& fit, const Emitter& emitter, Vec2 u_y0,
                  Vec2 u_d, float u_guide, EmissionSample& e) {
    const float a = fit.share[0];
    if (u_guide < a) {
        const Vec3 d = fit.mixture.sample({}, std::fmin(u_guide / a, kOneMinusEpsilon), u_y0);
        e = emitter.sample_emission_from(d, u_d);
    }
    e.pdf_y0 = origin_pdf(&guide, emitter, -e.d, e.pdf_y0);
}

/// Makes y_0, at the point of an emission.
Vertex& append_emitter(const WalkContext& walk, const Emitter& emitter, const EmissionSample& e,
                       SubPath& y) {
    ++walk.stats.light_paths;
    y.clear();
    Vertex& y0 = y.append();
    y0.kind = Vertex::Kind::Emitter;
    y0.emitter = &emitter;
    y0.is_infinite = emitter.is_infinite();
    y0.has_cosine = emitter.is_area();
    y0.p = y0.is_infinite ? -e.d : e.p;
    y0.ng = e.ng;
    y0.uv = e.uv;
    y0.location.prim = e.prim;
    y0.is_connectible = true;
    y0.medium = y0.is_infinite ? kVacuum : walk.scene.medium_at(emitter, y0.ray_end());
    y0.gloss = gloss_of_emitter(emitter.is_area());
    y0.pdf_fwd = emission_pmf(walk.counts.guide, emitter) * e.pdf_y0;
    y0.beta = Rgb(1 / y0.pdf_fwd);
    y0.guide = emission_cell(walk.counts.guide, emitter, y0.p);
    return y0;
}

/// Makes y_1, in the direction of the emission, if its ray hits a surface.
void leave_emitter(const WalkContext& walk, const EmissionSample& e, Sampler& sampler, SubPath& y) {
    const Vertex& y0 = y[0];
    if (!(e.pdf_d > 0)) return;
    const float cosine = y0.has_cosine ? abs_dot(e.ng, e.d) : 1.0f;
    Step step;
    step.ray = {y0.has_cosine ? offset_origin(y0.ray_end(), e.d) : e.p, e.d, kInf};
    step.beta = e.Le * (cosine / (y0.pdf_fwd * e.pdf_d));
    step.pdf_sa = e.pdf_d;
    step.medium = y0.medium_toward(e.d);
    trace(walk, sampler, y, step);
    if (append_end(walk, y, TransportMode::Importance, step))
        y[1].next_event_ratio = next_event_ratio(y[0], y[1], e.d, walk.counts.guide);
}

}  // namespace

bool start_light_path(const WalkContext& walk, Sampler& sampler, SubPath& y) {
    const Scene& scene = walk.scene;
    y.clear();
    if (!scene.has_emitters()) return false;
    sampler.seek(Stream::Light, 0);
    const Guide* guide = walk.counts.guide;
    const double u_emitter = sampler.next_1d_fine_if(scene.has_emitter_choice());
    const Emitter& emitter = guide && guide->chooses_emitters()
                                 ? scene.emitter(guide->sample_emitter(u_emitter))
                                 : scene.sample_emitter(u_emitter);
    const FinePoint u_y0 = sampler.next_2d_fine();
    const Vec2 u_d = sampler.next_2d();
    EmissionSample e = emitter.sample_emission(u_y0, u_d);
    const GuideFit* const fit = guide ? guide->at_infinity(emitter.index) : nullptr;
    if (fit) guide_origin(*guide, *fit, emitter, to_float(u_y0), u_d, sampler.next_1d(), e);
    if (!(e.pdf_y0 > 0)) return false;
    Vertex& y0 = append_emitter(walk, emitter, e, y);
    // Either the origin is guided or the direction. The numbers that follow have the same slots if neither is.
    const float u_guide = fit ? 0.0f : sampler.next_1d_if(y0.guide != nullptr);
    if (y0.guide) guide_emission(y0, u_d, u_guide, e);
    leave_emitter(walk, e, sampler, y);
    return true;
}

void start_light_path(const WalkContext& walk, const Emitter& emitter, const EmissionSample& e,
                      Sampler& sampler, SubPath& y) {
    append_emitter(walk, emitter, e, y);
    leave_emitter(walk, e, sampler, y);
}

template <TransportMode mode>
std::optional<BsdfSample> sample_scattering(const WalkContext& walk, Sampler& sampler,
                                            SubPath& path) {
    const int last = path.size() - 1;
    path.flight.pdf_sa = 0;
    if (last + 1 >= walk.options.max_vertices) return {};
    Vertex& v = path[last];
    if (v.kind != Vertex::Kind::Surface) return {};
    sampler.seek(mode == TransportMode::Radiance ? Stream::Eye : Stream::Light, uint64_t(last));
    const float u_lobe = sampler.next_1d_if(v.bsdf.uses_lobe_choice());
    const Vec2 u_direction = sampler.next_2d();
    const std::optional<Survival> q = survival<mode>(walk, path);
    const float u_roulette = sampler.next_1d_if(q.has_value());
    if (q) {
        v.survival = *q;
        if (!(u_roulette < v.survival.value())) return {};
    }
    // The numbers that follow have the same slots whether these are needed or not.
    const float u_guide = sampler.next_1d_if(v.guide != nullptr);
    const auto s = v.sample(u_lobe, u_direction, u_guide, mode);
    const float continued = walk.counts.continued;
    const bool may_end = mode == TransportMode::Radiance && continued < 1 && s &&
                         v.is_fixed_by_film && !next_is_fixed_by_film(v, s->is_delta, walk.scene);
    const float u_continued = sampler.next_1d_if(may_end);
    if (may_end) {
        const Survival both(v.survival.value() * continued);
        if (!(u_continued * v.survival.value() < both.value())) return {};
        v.survival = both;
    }
    return s;
}

namespace {

/// Leaves the last vertex by the event `s`.
template <TransportMode mode>
void leave(const BsdfSample& s, SubPath& path, Step& step) {
    const int last = path.size() - 1;
    Vertex& v = path[last];
    v.is_delta = s.is_delta;
    v.event = s.event;
    if (last >= 1) path[last - 1].pdf_rev = s.pdf_rev * v.to_predecessor;
    if (mode == TransportMode::Radiance) path.eta2 *= sqr(s.eta);
    path.gain *= s.gain;

    step.ray = {offset_origin(v.ray_end(), s.wi), s.wi, kInf};
    step.beta = v.beta * s.weight * (1 / v.survival.value());
    step.pdf_sa = s.pdf;
    step.medium = v.medium_toward(s.wi);
}

}  // namespace

template <TransportMode mode>
bool append(const WalkContext& walk, Sampler& sampler, const BsdfSample& s, SubPath& path) {
    Step step;
    leave<mode>(s, path, step);
    trace(walk, sampler, path, step);
    return append_end(walk, path, mode, step);
}

template <TransportMode mode>
void close(const WalkContext& walk, SubPath& path) {
    constexpr Side side = mode == TransportMode::Radiance ? Side::Eye : Side::Light;
    const int last = path.size() - 1;
    // The weights of hits and next events alone do not read the sum.
    if (last < 2 || !walk.counts.uses_light_paths()) return;
    // Level last-2 is known now; the levels below it were stored at the predecessor.
    path[last].weight_sum = level_sum<side>(path, last - 2, path[last - 1].weight_sum, walk.counts);
}

template <TransportMode mode>
bool begin_step(const WalkContext& walk, Sampler& sampler, SubPath& path, Step& step) {
    const auto s = sample_scattering<mode>(walk, sampler, path);
    if (!s) return false;
    leave<mode>(*s, path, step);
    trace(walk, sampler, path, step);
    return true;
}

template <TransportMode mode>
bool end_step(const WalkContext& walk, SubPath& path, Step& step) {
    if (!append_end(walk, path, mode, step)) return false;
    close<mode>(walk, path);
    return true;
}

template <TransportMode mode>
void walk_in_turns(const WalkContext& walk, std::span<WalkInTurn> walks) {
    const Scene& scene = walk.scene;
    std::array<WalkInTurn*, kWalksInTurn> going;
    size_t count = 0;
    for (WalkInTurn& w : walks) going[count++] = &w;
    while (count > 0) {
        const std::span<WalkInTurn*> all(going.data(), count);
        for (const WalkInTurn* w : all)
            if (w->step.found) scene.prefetch_primitive(w->step.hit);
        for (const WalkInTurn* w : all)
            if (w->step.found) scene.prefetch_vertices(w->step.hit);
        for (WalkInTurn* w : all) {
            if (!w->step.found) continue;
            scene.complete(w->step.hit);
            scene.prefetch_images(w->step.hit);
        }
        count = 0;
        for (WalkInTurn* w : all)
            if (end_step<mode>(walk, *w->path, w->step) &&
                begin_step<mode>(walk, *w->sampler, *w->path, w->step))
                going[count++] = w;
    }
}

constexpr auto kRadiance = TransportMode::Radiance, kImportance = TransportMode::Importance;
template std::optional<BsdfSample> sample_scattering<kRadiance>(const WalkContext&, Sampler&,
                                                                SubPath&);
template std::optional<BsdfSample> sample_scattering<kImportance>(const WalkContext&, Sampler&,
                                                                  SubPath&);
template bool append<kRadiance>(const WalkContext&, Sampler&, const BsdfSample&, SubPath&);
template bool append<kImportance>(const WalkContext&, Sampler&, const BsdfSample&, SubPath&);
template bool begin_step<kRadiance>(const WalkContext&, Sampler&, SubPath&, Step&);
template bool begin_step<kImportance>(const WalkContext&, Sampler&, SubPath&, Step&);
template bool end_step<kRadiance>(const WalkContext&, SubPath&, Step&);
template bool end_step<kImportance>(const WalkContext&, SubPath&, Step&);
template void walk_in_turns<kRadiance>(const WalkContext&, std::span<WalkInTurn>);
template void close<kRadiance>(const WalkContext&, SubPath&);
template void close<kImportance>(const WalkContext&, SubPath&);

}  // namespace etendue
