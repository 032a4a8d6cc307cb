#include "mcmc/path_state.h"

#include <algorithm>

#include "pathspace/mis.h"
#include "pathspace/path_pdfs.h"

namespace etendue {
namespace {

double inverse_square(const Vertex& a, const Vertex& b) {
    return a.is_infinite || b.is_infinite ? 1.0 : 1.0 / double(length2(b.p - a.p));
}

}  // namespace

PathImportance weighted_luminance(TargetMap map) {
    return [map = std::move(map)](const PathState& x, Rgb value) {
        return double(luminance(value)) * map(x.film);
    };
}

PathDensity luminance(const PathProduct& f) {
    constexpr Rgb kRed{1, 0, 0}, kGreen{0, 1, 0}, kBlue{0, 0, 1};
    return f[0] * PathDensity(luminance(kRed)) + f[1] * PathDensity(luminance(kGreen)) +
           f[2] * PathDensity(luminance(kBlue));
}

PathMeasure::PathMeasure(const Scene& of, const FilmRegion& region, int shortest_path,
                         int longest_path)
    : scene(of), film(region), shortest(shortest_path), longest(longest_path), unit_area(1) {
    const double radius = scene.bounds().is_empty() ? 0 : double(scene.bounds().radius());
    if (radius > 0) unit_area = sqr(radius);
}

void PathState::append(const Vertex& v) {
    x_.emplace_back().v = v;
    Vertex& added = x_.back().v;
    added.lights = nullptr;  // Mutations select emitters as everywhere.
    if (added.kind == Vertex::Kind::Surface) {
        arena_.adopt(added.bsdf);
        const Material& material = *added.shape->material;
        x_.back().opacity = material.is_opaque() ? 1 : measure_.scene.opacity(added.location);
    } else {
        added.bsdf = {};
        // The vertex of an eye path that left the scene belongs to all emitters at infinity.
        if (added.emitter)
            x_.back().opacity = added.emitter->opacity(added.uv, added.location.prim);
    }
}

void PathState::append(const PathVertex& v) {
    x_.push_back(v);
    arena_.adopt(x_.back().v.bsdf);
}

void PathState::copy(const PathState& from) {
    clear();
    for (const PathVertex& v : from.x_) append(v);
    target = from.target;
    edges = from.edges;
    splats = from.splats;
    film = from.film;
    large_step_density_ = from.large_step_density_;
}

double PathState::geometry(int from, int to) const {
    return measure_.unit_area * double(to_area(1, x_[size_t(from)].v, x_[size_t(to)].v));
}

/// The factor of f at x_i for light that arrives from x_{i-1}, without masks: |cos θ|/d² per unit_area.
double PathState::arrival(int i) const {
    const Vertex &before = x_[size_t(i) - 1].v, &x = x_[size_t(i)].v;
    return measure_.unit_area * inverse_square(before, x) *
           double(abs_dot(x.ng, direction(x, before)));
}

void PathState::scatter(int i) {
    PathVertex& x = x_[size_t(i)];
    PathVertex &before = x_[size_t(i) - 1], &after = x_[size_t(i) + 1];
    const Vec3 to_light = direction(x.v, before.v), to_eye = direction(x.v, after.v);
    double pdf_light = 0, pdf_eye = 0;  // in solid angle
    x.value = {};
    if (x.v.is_delta) {
        const auto event = x.v.bsdf.sample_delta(to_light, x.v.event, TransportMode::Importance);
        const auto back = x.v.bsdf.sample_delta(to_eye, x.v.event, TransportMode::Radiance);
        if (event && back) {
            x.value = event->weight * event->pdf;
            pdf_light = event->pdf, pdf_eye = event->pdf_rev;
            x.light_pmf = event->pdf, x.eye_pmf = back->pdf;
        }
    } else {
        const BsdfEval e = x.v.bsdf.eval(to_light, to_eye, TransportMode::Importance);
        x.value = e.f;
        pdf_light = e.pdf, pdf_eye = e.pdf_rev;
    }
    after.light_ = pdf_light * geometry(i, i + 1);
    before.eye_ = pdf_eye * geometry(i, i - 1);
    // An eye path that leaves the scene chooses among the emitters at infinity.
    if (before.v.is_infinite && !emitter().is_delta())
        before.eye_ /= double(measure_.scene.infinite_emitters().size());
    x.factor = arrival(i) * double(x.opacity);
}

bool PathState::evaluate(int first, int last) {
    const Scene& scene = measure_.scene;
    const int k = this->last();
    for (int i = std::max(first, 1); i <= std::min(last, k - 1); ++i) {
        scatter(i);
        if (x_[size_t(i)].is_black()) return false;
    }
    if (first <= 0) {
        PathVertex& x0 = x_[0];
        const Emitter& e = emitter();
        const Vec3 w = direction(x0.v, x_[1].v);
        const Emitter::Emission emission = e.eval_emission(x0.v.ng, x0.v.uv, x0.v.location.prim, w);
        x0.value = emission.Le_cos;
        if (x0.value.is_zero()) return false;
        x0.light_ = x0.next_event_ = measure_.unit_area * double(e.selection_pmf);
        if (!e.is_delta()) {
            const EmitterHit hit = e.is_infinite()
                                       ? e.eval_infinite(x0.v.p)
                                       : e.eval_surface(x0.v.ng, x0.v.uv, x0.v.location.prim, w);
            x0.light_ *= double(hit.pdf_y0);
            x0.next_event_ *=
                e.is_infinite()
                    ? double(hit.pdf)
                    : double(e.direct_pdf(x0.v.p, x0.v.ng, x0.v.location.prim, x_[1].v.p));
        }
        x_[1].light_ = emission.pdf_d * geometry(0, 1);
    }
    if (last >= k) {
        PathVertex& xk = x_[size_t(k)];
        const float pdf_dir =
            scene.sensor().pdf_direction(xk.v.p, direction(xk.v, x_[size_t(k) - 1].v));
        xk.eye_ = measure_.unit_area * double(xk.v.pdf_fwd);
        x_[size_t(k) - 1].eye_ = double(pdf_dir / measure_.film.area()) * geometry(k, k - 1);
        xk.value = Rgb(1);
        xk.factor = sqr(measure_.unit_area) * inverse_square(x_[size_t(k) - 1].v, xk.v) *
                    double(pdf_dir) * double(xk.v.pdf_fwd);
        if (xk.is_black()) return false;
    }
    for (int i = std::max(first, 0); i < std::min(last, k); ++i) {
        const Vertex &a = x_[size_t(i)].v, &b = x_[size_t(i) + 1].v;
        Rgb& attenuation = x_[size_t(i)].attenuation;
        attenuation = Rgb(1);
        if (!scene.has_media()) continue;
        const Vec3 w = direction(a, b);
        if (i + 1 < k)
            attenuation = edge_attenuation(scene, a, b, w);
        else if (a.is_infinite)
            attenuation = scene.attenuation_to_infinity(scene.sensor_medium(), {b.p}, a.p);
        else
            attenuation = scene.attenuation(a.medium_toward(w), a.ray_end(), {lens_point()});
    }
    return true;
}

Vec3 PathState::lens_point() const {
    const Vertex& lens = x_.back().v;
    if (!lens.is_infinite) return lens.p;
    const auto at = measure_.scene.sensor().connection_to({}, x_[x_.size() - 2].v.p, false);
    return at ? at->p : x_[x_.size() - 2].v.p;
}

bool PathState::trace_edge(int i, RenderStats& stats) {
    const Scene& scene = measure_.scene;
    const Vertex &a = x_[size_t(i)].v, &b = x_[size_t(i) + 1].v;
    const RayEnd end = i + 1 == last() ? RayEnd{lens_point()} : b.ray_end();
    ++stats.shadow_rays;
    float& Tr = x_[size_t(i)].transmittance;
    Tr = a.is_infinite ? scene.transmittance_to_infinity(end, a.p)
                       : scene.transmittance(end, a.ray_end());
    stats.visible += Tr > 0;
    return Tr > 0;
}

bool PathState::is_sampled_by(int s) const {
    return s == 0 ? !emitter().is_delta() : s == size() || is_connected_at(s - 1);
}

PathDensity PathState::density(int s) const {
    if (!is_sampled_by(s)) return 0;
    PathDensity p = 1;
    for (int i = 0; i < s; ++i) p *= s == 1 ? next_event() : light(i);
    for (int i = s; i <= last(); ++i) p *= eye(i);
    return p;
}

PathDensity PathState::density(const UserPaths& paths, int s) const {
    if (s < 2 || s >= size() || !is_connected_at(s - 1)) return 0;
    std::vector<const Vertex*> light;
    PathDensity p = 1;
    for (int i = 0; i < s; ++i) {
        light.push_back(&x_[size_t(i)].v);
        p *= measure_.unit_area;
        if (i > 0) p *= met_from_light(i);
    }
    return p * paths.density(light);
}

PathDensity PathState::independent_path_density() {
    const int k = last();
    // Of the eye sub-paths x_s … x_k.
    eye_densities_.resize(size_t(k) + 2);
    eye_densities_.back() = 1;
    for (int s = k; s >= 0; --s) eye_densities_[size_t(s)] = eye(s) * eye_densities_[size_t(s) + 1];
    PathDensity T = 0, of_light = 1;
    for (int s = 0; s <= k + 1; ++s) {
        if (const double p = target_.techniques.pmf(k, s); p > 0 && is_sampled_by(s))
            T += p * (s == 1 ? next_event() : of_light) * eye_densities_[size_t(s)];
        if (s <= k) of_light *= light(s);
    }
    T *= target_.lengths.pmf(k);
    const UserSteps& user = target_.user;
    if (!user.paths) return T;
    PathDensity T_user = 0;
    for (int s = 2; s <= std::min(k, user.paths->longest()); ++s)
        if (const PathDensity p = density(*user.paths, s); p > 0)
            T_user +=
                p * UserSteps::pmf(s, k + 1 - s, measure_.shortest) * eye_densities_[size_t(s)];
    return (1 - user.share) * T + user.share * T_user;
}

PathProduct PathState::contribution() const {
    PathProduct f{1, 1, 1};
    for (const PathVertex& x : x_)
        for (int c = 0; c < 3; ++c)
            f[size_t(c)] *=
                double(x.value[c]) * x.factor *
                (&x == &x_.back() ? 1.0 : double(x.attenuation[c]) * double(x.transmittance));
    return f;
}

PathProduct PathState::flux(int i) const {
    // One unit_area for each vertex, x_0 included.
    const double end = measure_.unit_area * arrival(i) * double(x_[size_t(i)].opacity);
    PathProduct f{end, end, end};
    for (int j = 0; j < i; ++j) {
        const PathVertex& x = x_[size_t(j)];
        for (int c = 0; c < 3; ++c)
            f[size_t(c)] *=
                double(x.value[c]) * x.factor * double(x.attenuation[c]) * double(x.transmittance);
    }
    return f;
}

void PathState::set_black() {
    target = 0;
    splats.clear();
}

void PathState::finish(RenderStats& stats) {
    set_black();
    edges = last();
    const PathDensity T = large_step_density_ = independent_path_density();
    if (T == 0) return;
    const PathProduct f = contribution();
    const Rgb value(float(f[0] / T), float(f[1] / T), float(f[2] / T));
    const double I = target_.importance(*this, value);
    if (!std::isfinite(T) || !is_finite(value) || !std::isfinite(I)) {
        ++stats.rejected;
        return;
    }
    if (!(I > 0)) return;
    target = I;
    splats.push_back({film, value});
}

void PathState::tell(const TechniqueCounts& counts, Workspace& work, ContributionSink& sink) const {
    SubPath &y = work.y, &z = work.z;
    y.clear(), z.clear();
    const int n = size();
    for (int i = 0; i < n; ++i) y.append() = x_[size_t(i)].v;
    for (int i = n; i-- > 0;) z.append() = x_[size_t(i)].v;
    z.film = film, z.film_weight = 1;
    // Counts refer to densities per pixel.
    std::vector<PathDensity> squares(size_t(n) + 1);
    PathDensity sum = 0;
    for (int s = 0; s <= n; ++s) {
        const double per_pixel = n - s >= 2 ? double(measure_.film.area()) : 1.0;
        const double np = double(counts.of(connection_technique(s, n - s)));
        sum += squares[size_t(s)] = sqr(np * density(s) * per_pixel);
    }
    for (int s = 0; s <= n; ++s) {
        if (!(squares[size_t(s)] > 0)) continue;
        Join join{.technique = connection_technique(s, n - s),
                  .emitter = &emitter(),
                  .contribution = splats[0].value,
                  .mis_weight = float(squares[size_t(s)] / sum),
                  .film = film,
                  .needs_test = false};
        if (s > 0 && s < n) {
            const Vertex &a = x_[size_t(s) - 1].v, &b = x_[size_t(s)].v;
            join.a = {b.p}, join.b = {a.p}, join.to_infinity = a.is_infinite;
        }
        sink.add(join, join.contribution);
    }
}

namespace {

/// What is saved of a vertex: BSDFs are made again.
struct SavedVertex {
    Vec3 p, ng, wo;
    Vec2 uv;
    SurfaceLocation location;
    uint32_t emitter = 0;  ///< Index.
    float pdf_fwd = 0, transmittance = 0;
    MediumId medium = 0;
    Vertex::Kind kind{};
    bool is_delta = false, is_infinite = false, has_cosine = false;
    uint8_t event = 0;
    uint8_t zero = 0;  ///< Instead of padding.
};

}  // namespace

void PathState::save(LearnedState& to) const {
    ChainState::save(to);
    to.put(film);
    std::vector<SavedVertex> saved;
    const auto none = uint32_t(measure_.scene.emitters().size());
    for (const PathVertex& x : x_) {
        SavedVertex& v = saved.emplace_back();
        v.p = x.v.p, v.ng = x.v.ng, v.wo = x.v.wo, v.uv = x.v.uv;
        v.location = x.v.location;
        v.emitter = x.v.emitter ? x.v.emitter->index : none;
        v.pdf_fwd = x.v.pdf_fwd, v.transmittance = x.transmittance;
        v.medium = x.v.medium, v.kind = x.v.kind, v.is_delta = x.v.is_delta;
        v.is_infinite = x.v.is_infinite, v.has_cosine = x.v.has_cosine, v.event = x.v.event;
    }
    to.put(saved);
}

void PathState::load(LearnedState& from) {
    ChainState::load(from);
    from.get(film);
    std::vector<SavedVertex> saved;
    from.get(saved);
    clear();
    const Scene& scene = measure_.scene;
    for (const SavedVertex& s : saved) {
        Vertex v;
        v.medium = s.medium;
        if (s.kind == Vertex::Kind::Surface) {
            if (s.location.shape >= scene.shapes().size())
                throw std::runtime_error("the learned state is of another scene");
            v.set_surface(scene.shape(s.location.shape), s.location, scene.surface(s.location),
                          s.wo, arena_);
        } else {
            v.kind = s.kind;
            v.p = s.p, v.ng = s.ng, v.wo = s.wo, v.uv = s.uv;
            v.location = s.location;
            v.is_connectible = true;
            if (s.kind == Vertex::Kind::Emitter) {
                if (s.emitter >= scene.emitters().size())
                    throw std::runtime_error("the learned state is of another scene");
                v.emitter = scene.emitters()[s.emitter].get();
            }
        }
        v.pdf_fwd = s.pdf_fwd;
        v.is_infinite = s.is_infinite, v.has_cosine = s.has_cosine;
        v.is_delta = s.is_delta, v.event = s.event;
        append(v);
        x_.back().transmittance = s.transmittance;
    }
    const double saved_target = target;
    RenderStats unused;
    if (size() >= 2 && evaluate(0, last())) finish(unused);
    if (target != saved_target) throw std::runtime_error("the learned state is of another scene");
}

}  // namespace etendue
