#include "mcmc/path_builder.h"

#include <algorithm>

#include "math/warp.h"

namespace etendue {
namespace {

/// The counts of walks whose MIS weights are not needed.
constexpr TechniqueCounts kNoCounts{};

SubPath& side(Workspace& work, TransportMode mode) {
    return mode == TransportMode::Radiance ? work.z : work.y;
}

/// Begins a sub-path with a kept vertex, whose predecessor is `before`, on the same side.
void keep(SubPath& path, const Vertex& v, const Vertex* before) {
    path.clear();
    Vertex& first = path.append();
    first = v;
    first.is_delta = false;
    if (before) first.wo = direction(v, *before);
}

/// Emission from the kept x_0, in a direction of its own, or from the disc at infinity.
EmissionSample emission_from(const Vertex& x0, Vec2 u) {
    const Emitter& emitter = *x0.emitter;
    EmissionSample e{.p = x0.p,
                     .ng = x0.ng,
                     .d = {},
                     .Le = Rgb(1),
                     .pdf_y0 = 1,
                     .pdf_d = 1,
                     .uv = x0.uv,
                     .prim = x0.location.prim};
    if (!emitter.is_infinite()) {
        e.d = emitter.sample_direction(x0.ng, u);
        return e;
    }
    const Vec2 disc = sample_uniform_disk(u);
    const Frame frame = Frame::from_normal(x0.p);
    const Emitter::Disc at = emitter.disc();
    e.d = -x0.p;
    e.p = at.center + (frame.s * disc.x + frame.t * disc.y + x0.p) * at.radius;
    return e;
}

}  // namespace

PathBuilder::PathBuilder(const PathMeasure& measure, Sampler& sampler, Workspace& work,
                         const PathState* x, int l, int m)
    : measure_(measure), sampler_(sampler), work_(work), x_(x), l_(l), m_(m),
      light_end_(keeps_light() ? LightEnd::Kept : LightEnd::Hit),
      eye_end_(keeps_eye() ? EyeEnd::Kept : EyeEnd::Connected), walk_{measure.scene,
                                                                      kNoCounts,
                                                                      work.stats,
                                                                      {}} {
    work_.y.clear(), work_.z.clear();
    if (keeps_light()) keep(work_.y, (*x)[l].v, l >= 1 ? &(*x)[l - 1].v : nullptr);
    if (keeps_eye()) {
        keep(work_.z, (*x)[m].v, m < x->last() ? &(*x)[m + 1].v : nullptr);
        film_ = x->film;
    }
}

template <TransportMode mode>
bool PathBuilder::step(const BsdfSample& s) {
    SubPath& path = side(work_, mode);
    const int size = path.size();
    // append() continues from the throughput of the kept vertex, which has none.
    path[size - 1].beta = Rgb(1);
    if (!append<mode>(walk_, sampler_, s, path)) return false;
    ++(mode == TransportMode::Radiance ? new_eye_ : new_light_);
    return true;
}

template <TransportMode mode>
bool PathBuilder::sample_step() {
    SubPath& path = side(work_, mode);
    path.flight.pdf_sa = 0;
    const Vertex& v = path[path.size() - 1];
    if (v.kind != Vertex::Kind::Surface) return false;
    sampler_.seek(mode == TransportMode::Radiance ? Stream::Eye : Stream::Light,
                  uint64_t(path.size()));
    const float u_lobe = sampler_.next_1d();
    const auto s = v.sample_unguided(u_lobe, sampler_.next_2d(), mode);
    return s && step<mode>(*s);
}

bool PathBuilder::sample_light_step() {
    return sample_step<TransportMode::Importance>();
}
bool PathBuilder::sample_eye_step() {
    return sample_step<TransportMode::Radiance>();
}
bool PathBuilder::step_light(const BsdfSample& s) {
    return step<TransportMode::Importance>(s);
}
bool PathBuilder::step_eye(const BsdfSample& s) {
    return step<TransportMode::Radiance>(s);
}

void PathBuilder::append_chain_vertex(const Vertex& v) {
    Vertex& added = work_.z.append();
    added = v;
    work_.z.arena.adopt(added.bsdf);
    added.is_delta = true;
    ++new_eye_;
    is_joined_by_chain_ = true;
}

bool PathBuilder::start_light(const Emitter& emitter, const EmissionSample& e) {
    if (!keeps_light()) light_end_ = LightEnd::Sampled;
    start_light_path(walk_, emitter, e, sampler_, work_.y);
    new_light_ = work_.y.size() - keeps_light();
    return work_.y.size() == 2;
}

bool PathBuilder::follow(const UserPaths& paths) {
    light_end_ = LightEnd::Sampled;
    if (!paths.sample(walk_, sampler_, work_.y) || !light_end().is_connectible) return false;
    new_light_ = work_.y.size();
    return true;
}

bool PathBuilder::sample(int from_light, int from_eye) {
    if (!keeps_light())
        light_end_ = from_light == 0   ? LightEnd::Hit
                     : from_light == 1 ? LightEnd::NextEvent
                                       : LightEnd::Sampled;
    if (!keeps_eye())
        eye_end_ = from_eye == 0   ? EyeEnd::Hit
                   : from_eye == 1 ? EyeEnd::Connected
                                   : EyeEnd::Sampled;
    return sample_light(from_light) && sample_eye(from_eye);
}

void PathBuilder::take(const Join& join, const Flight& flight) {
    const int s = join.technique.s, t = join.technique.t;
    SubPath &y = work_.y, &z = work_.z;
    light_end_ = s == 0 ? LightEnd::Hit : s == 1 ? LightEnd::NextEvent : LightEnd::Sampled;
    eye_end_ = t == 0 ? EyeEnd::Hit : t == 1 ? EyeEnd::Connected : EyeEnd::Sampled;
    y.truncate(s >= 2 ? s - (t == 0) : 0);
    z.truncate(t >= 2 ? t : 0);
    y.flight = flight;
    film_ = join.film;
    // As join_next_event() and join_splat() read them.
    emitter_numbers_ = uint64_t(t) - 1;
    lens_numbers_ = uint64_t(s) + 0x8000u;
    emitter_ = join.emitter;
}

bool PathBuilder::sample_eye_path(int count) {
    eye_end_ = count == 1 ? EyeEnd::Connected : EyeEnd::Sampled;
    return sample_eye(count);
}

bool PathBuilder::sample_light(int count) {
    const bool ends_at_lens = eye_end_ == EyeEnd::Hit;
    // The ray to the lens leaves a new vertex or a kept one; a next event has none.
    if (ends_at_lens && (count == 0 || light_end_ == LightEnd::NextEvent)) return false;
    if (count == 0 || light_end_ == LightEnd::NextEvent) return true;
    if (l_ <= 0) {
        sampler_.seek(Stream::Light, 0);
        const Scene& scene = measure_.scene;
        bool has_started;
        if (l_ == 0) {
            const Vertex x0 = work_.y[0];
            has_started = start_light(*x0.emitter, emission_from(x0, sampler_.next_2d()));
        } else {
            if (!scene.has_emitters()) return false;
            const Emitter& emitter =
                scene.sample_emitter(sampler_.next_1d_fine_if(scene.has_emitter_choice()));
            const FinePoint u_y0 = sampler_.next_2d_fine();
            has_started = start_light(emitter, emitter.sample_emission(u_y0, sampler_.next_2d()));
        }
        if (!has_started) return false;
    }
    const int surfaces = count - ends_at_lens;
    while (new_light_ < surfaces)
        if (!sample_step<TransportMode::Importance>()) return false;
    if (!ends_at_lens) return true;
    // The last ray may continue beyond the lens; surfaces behind it do not matter.
    const int size = work_.y.size();
    sample_step<TransportMode::Importance>();
    work_.y.truncate(size);
    return work_.y.flight.pdf_sa > 0;
}

bool PathBuilder::start_eye(Vec2 film) {
    if (!measure_.film.contains(film)) return false;
    film_ = film;
    const Vec3 lens = work_.z[0].p;
    start_eye_path(walk_, Film::PixelSample{film, 1}, measure_.scene.sensor().ray_from(lens, film),
                   sampler_, work_.z);
    new_eye_ = work_.z.size() - 1;
    return work_.z.size() == 2;
}

bool PathBuilder::start_eye_anywhere() {
    eye_end_ = EyeEnd::Sampled;
    sampler_.seek(Stream::Eye, 0);
    const Vec2 u = sampler_.next_2d();
    film_ = {measure_.film.low.x + u.x * measure_.film.size.x,
             measure_.film.low.y + u.y * measure_.film.size.y};
    start_eye_path(walk_, Film::PixelSample{film_, 1}, sampler_.next_2d(), sampler_, work_.z);
    new_eye_ = work_.z.size();
    return work_.z.size() == 2;
}

bool PathBuilder::sample_eye(int count) {
    if (count == 0 || eye_end_ == EyeEnd::Connected) return true;
    if (!keeps_eye()) {
        if (!start_eye_anywhere()) return false;
    } else if (m_ == x_->last()) {
        sampler_.seek(Stream::Eye, 0);
        const Vec2 u = sampler_.next_2d();
        if (!start_eye({measure_.film.low.x + u.x * measure_.film.size.x,
                        measure_.film.low.y + u.y * measure_.film.size.y}))
            return false;
    }
    while (new_eye_ < count)
        if (!sample_step<TransportMode::Radiance>()) return false;
    return true;
}

bool PathBuilder::append_emitter_point(const Vertex& from, PathState& y) {
    const Scene& scene = measure_.scene;
    if (!scene.has_emitters() || !from.is_connectible || from.kind == Vertex::Kind::Sensor)
        return false;
    sampler_.seek(Stream::Connection, emitter_numbers_);
    const double u = sampler_.next_1d_fine_if(scene.has_emitter_choice());
    const Emitter& emitter = emitter_ ? *emitter_ : scene.sample_emitter(u);
    DirectSample d;
    if (!emitter.sample_direct(from.p, sampler_.next_2d_fine(), d)) return false;
    Vertex v;
    v.kind = Vertex::Kind::Emitter;
    v.emitter = &emitter;
    v.p = d.p, v.ng = d.ng, v.uv = d.uv;
    v.location.prim = d.prim;
    v.is_infinite = emitter.is_infinite();
    v.has_cosine = emitter.is_area();
    v.is_connectible = true;
    v.medium = v.is_infinite ? kVacuum : scene.medium_at(emitter, v.ray_end());
    y.append(v);
    return true;
}

bool PathBuilder::append_hit_emitter(const Vertex& hit, PathState& y) {
    const auto& infinite = measure_.scene.infinite_emitters();
    const Emitter* emitter = hit.emitter;
    if (hit.is_infinite && emitter_) {
        emitter = emitter_;
    } else if (hit.is_infinite) {
        if (infinite.empty()) return false;
        sampler_.seek(Stream::Connection, emitter_numbers_);
        const auto i = size_t(sampler_.next_1d() * float(infinite.size()));
        emitter = infinite[std::min(i, infinite.size() - 1)];
    }
    if (!emitter || emitter->is_delta()) return false;
    Vertex v = hit;
    v.kind = Vertex::Kind::Emitter;
    v.emitter = emitter;
    v.shape = nullptr;
    v.has_cosine = emitter->is_area();
    v.is_connectible = true;
    v.is_delta = false;
    v.medium = v.is_infinite ? kVacuum : measure_.scene.medium_at(*emitter, v.ray_end());
    y.append(v);
    return true;
}

bool PathBuilder::append_lens(const Vertex& from, PathState& y) {
    const Sensor& sensor = measure_.scene.sensor();
    if (from.is_infinite && sensor.is_orthographic()) return false;
    if (keeps_eye()) {
        const Vertex& lens = (*x_)[m_].v;
        const auto at = sensor.connection_to(lens.p, from.p, from.is_infinite);
        if (!at) return false;
        y.append(lens);
        y.film = at->film;
        return true;
    }
    sampler_.seek(Stream::Connection, lens_numbers_);
    const auto at = sensor.sample_connection(from.p, from.is_infinite, sampler_.next_2d());
    if (!at) return false;
    Vertex v;
    v.kind = Vertex::Kind::Sensor;
    v.is_infinite = sensor.is_orthographic();
    v.ng = at->ng;
    v.p = v.is_infinite ? -at->ng : at->p;
    v.pdf_fwd = at->pdf_pos;
    v.is_connectible = true;
    y.append(v);
    y.film = at->film;
    return true;
}

bool PathBuilder::append_lens_hit(PathState& y) {
    const Flight& flight = work_.y.flight;
    const Vertex& a = light_end();
    const Vec3 origin = a.is_infinite ? flight.o : a.p;
    const auto at = measure_.scene.sensor().hit_lens(origin, flight.d, flight.length);
    if (!at) return false;
    Vertex v;
    v.kind = Vertex::Kind::Sensor;
    v.ng = at->ng;
    v.p = at->p;
    v.pdf_fwd = at->pdf_pos;
    v.is_connectible = true;
    y.append(v);
    y.film = at->film;
    return true;
}

bool PathBuilder::finish(PathState& y) {
    const SubPath &light = work_.y, &eye = work_.z;
    y.clear();
    y.film = film_;
    if (keeps_light()) {
        for (int i = 0; i <= l_; ++i) y.append((*x_)[i]);
        y[l_].v.is_delta = light[0].is_delta;
        y[l_].v.event = light[0].event;
    }
    for (int i = keeps_light(); i < light.size(); ++i) y.append(light[i]);

    int sampled_eye = eye.size() - keeps_eye();
    if (light_end_ == LightEnd::NextEvent || light_end_ == LightEnd::Hit) {
        if (eye.size() == 0) return false;
        if (light_end_ == LightEnd::NextEvent) {
            if (!append_emitter_point(eye_end(), y)) return false;
        } else {
            if (sampled_eye == 0 || !append_hit_emitter(eye_end(), y)) return false;
            --sampled_eye;
        }
    }
    const int joint = y.size() - 1;  // The edge that starts here joins both sides.
    const int first_eye = keeps_eye();
    for (int i = first_eye + sampled_eye; i-- > first_eye;) y.append(eye[i]);
    int changed = y.size();  // The last vertex with another neighbour.
    switch (eye_end_) {
    case EyeEnd::Hit:
        if (!append_lens_hit(y)) return false;
        break;
    case EyeEnd::Connected:
        if (!append_lens(y[joint].v, y)) return false;
        break;
    case EyeEnd::Kept:
        if (m_ == x_->last() && sampled_eye == 0) {  // The kept lens, through another film point.
            if (!append_lens(y[joint].v, y)) return false;
            break;
        }
        for (int i = m_; i <= x_->last(); ++i) y.append((*x_)[i]);
        y[changed].v.is_delta = eye[0].is_delta;
        y[changed].v.event = eye[0].event;
        break;
    case EyeEnd::Sampled: break;
    }
    const int k = y.last();
    changed = std::min(changed, k);
    if (k < measure_.shortest || k > measure_.longest) return false;
    const bool is_joined = light_end_ != LightEnd::Hit && eye_end_ != EyeEnd::Hit;
    if (is_joined) {
        for (const int i : {joint, joint + 1}) {
            if (i > joint && is_joined_by_chain_) break;
            if (!y[i].v.is_connectible) return false;
            y[i].v.is_delta = false;
        }
    }
    const int first = std::max(l_, 0);
    if (!y.evaluate(first, changed)) return false;
    for (int i = first; i < changed; ++i) {
        y[i].transmittance = 1;
        const bool needs_ray = (is_joined && i == joint) || measure_.scene.has_masks();
        if (needs_ray && !y.trace_edge(i, work_.stats)) return false;
    }
    return true;
}

}  // namespace etendue
