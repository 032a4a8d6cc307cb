#include "manifold/specular_connection.h"

namespace etendue {
namespace {

/// Weight of X against the hit: `ratio` is p̂ over the hit's density.
double specular_weight(double ratio) {
    return std::isinf(ratio) ? 1 : sqr(ratio) / (1 + sqr(ratio));
}

/// p̂ over the density of the hit, both without the probabilities of the events, which they share. `pdf`: density of the
/// chain's first direction.
double density_ratio(const LampPoint& lamp, const ChainRay& ray, double jacobian, double pdf) {
    const double cosine = lamp.is_infinite() ? 1 : std::fabs(dot(Vec3d(lamp.ng), ray.d));
    const double length = lamp.is_infinite() ? 1 : ray.way + lamp.passed_by(ray).distance;
    return kSolutionShare * spread(jacobian, length) * lamp.pdf / (pdf * jacobian * cosine);
}

/// x_0 of a path whose light leaves along `w`; the chain's eye vertex selects its emitter with the probability `pmf`.
LampPoint lamp_point(const Vertex& x0, const Emitter& emitter, float pmf, Vec3 w) {
    const EmitterHit e = x0.is_infinite ? emitter.eval_infinite(x0.p)
                                        : emitter.eval_surface(x0.ng, x0.uv, x0.location.prim, w);
    return {.emitter = &emitter,
            .p = x0.p,
            .ng = x0.ng,
            .uv = x0.uv,
            .prim = x0.location.prim,
            .pdf = double(pmf) * double(e.pdf_y0)};
}

/// Draws y_0, on an emitter that next events at `from` would select; its density is 0 where it has none.
LampPoint draw_lamp_point(const Scene& scene, const Vertex& from, Sampler& sampler) {
    const Emitter& emitter =
        select_emitter(scene, from, sampler.next_1d_fine_if(scene.has_emitter_choice()));
    const EmissionSample e = emitter.sample_emission(sampler.next_2d_fine(), {0.5f, 0.5f});
    return {.emitter = &emitter,
            .p = emitter.is_infinite() ? -e.d : e.p,
            .ng = e.ng,
            .uv = e.uv,
            .prim = e.prim,
            .pdf = double(next_event_pmf(from, emitter)) * double(e.pdf_y0)};
}

/// A chain between z_{t-1} and y_0, with what the path contributes along it, without the number of trials.
struct Solution {
    Vec3d w;
    ChainEvents events;
    Rgb contribution;
    double weight = 0;
};

/// The path along the direction `w` that Newton's method has found, and the tracer has followed; empty where it contributes
/// nothing.
std::optional<Solution> evaluate(const Vertex& from, const LampPoint& lamp, Vec3d w,
                                 const ChainEvents& events, ChainTracer& tracer) {
    const BsdfEval f = from.eval(to_float(w), TransportMode::Radiance);
    if (f.f.is_zero()) return {};
    const ChainRay& ray = tracer.ray();
    const Rgb emitted = lamp.emission(-to_float(ray.d));
    if (emitted.is_zero()) return {};
    const double jacobian = lamp.passed_by(ray).jacobian();
    const Rgb C = from.beta * f.f * tracer.value() * emitted * float(jacobian / lamp.pdf);
    if (C.is_zero()) return {};
    const Rgb Tr = tracer.transmittance_to(lamp);
    if (Tr.is_zero()) return {};
    const double weight = lamp.emitter->is_delta()
                              ? 1
                              : specular_weight(density_ratio(lamp, ray, jacobian, double(f.pdf)));
    return Solution{w, events, C * Tr, weight};
}

/// Number of seeds until one leads to the solution; empty where it is larger than `most`.
std::optional<uint64_t> count_trials(const Solution& found, const LampPoint& lamp,
                                     ChainSeeds& seeds, ChainTracer& tracer, uint64_t most,
                                     Sampler& sampler, Workspace& work) {
    constexpr uint64_t kSeldom = 1024;
    for (uint64_t n = 1; n <= most; ++n) {
        if (n % kSeldom == 0) work.go_on();
        ++work.stats.chain_trials;
        const auto seed = seeds.draw(sampler, &found.events);
        if (!seed || !(seed->events == found.events)) continue;
        const auto w = tracer.solve(seed->w, seed->events, seed->ray, lamp.target());
        if (w && is_same_solution(*w, found.w)) return n;
    }
    return {};
}

/// Makes `y` the light side of the path, from y_0 on.
void record(const LampPoint& lamp, const Solution& found, ChainTracer& tracer, SubPath& y) {
    y.clear();
    for (int i = 0; i <= found.events.count; ++i) y.append();
    Vertex& y0 = y[0];
    y0.kind = Vertex::Kind::Emitter;
    y0.emitter = lamp.emitter;
    y0.p = lamp.p;
    y0.is_infinite = lamp.is_infinite();
    tracer.start(found.w);
    for (int i = 0; i < found.events.count; ++i) {
        tracer.advance();
        tracer.leave(found.events.number[size_t(i)]);
        Vertex& v = y[found.events.count - i];
        v.kind = Vertex::Kind::Surface;
        v.p = tracer.vertex().p;
        v.ng = tracer.vertex().ng;
        v.shape = tracer.vertex().shape;
        v.event = tracer.vertex().event;
        v.is_delta = true;
    }
}

/// Factor of the weight of a hit of the lamp behind a chain. `pdf`: density of the chain's first direction.
float rest_beside(const LampPoint& lamp, const ChainRay& ray, double pdf) {
    const double ratio = density_ratio(lamp, ray, lamp.passed_by(ray).jacobian(), pdf);
    return float(1 - specular_weight(ratio));
}

}  // namespace

bool is_left_to_hits(const SubPath& z, int t, const TechniqueCounts& counts) {
    // Any vertex without delta event can be merged.
    if (counts.merge > 0) return false;
    for (int i = t - 1; i > 0; --i) {
        const bool is_smooth_pair = (i == t - 1 || !z[i].is_delta) && !z[i - 1].is_delta;
        if (is_smooth_pair && counts.makes_smooth_pairs(i == 1)) return false;
    }
    return true;
}

std::optional<Join> join_specular(const Scene& scene, const SubPath& z, int t,
                                  const SpecularLimits& limits, Sampler& sampler,
                                  const TechniqueCounts& counts, Workspace& work) {
    // Numbers of seeds and trials, which are many.
    constexpr uint64_t kTrials = uint64_t(1) << 32;
    const Vertex& from = z[t - 1];
    const int depth = std::min(counts.specular_depth, limits.max_depth - t);
    if (depth < 1 || !from.is_connectible || !scene.has_emitters()) return {};
    if (!is_left_to_hits(z, t, counts)) return {};

    sampler.seek(Stream::Auxiliary, uint64_t(t));
    const LampPoint lamp = draw_lamp_point(scene, from, sampler);
    if (!(lamp.pdf > 0)) return {};
    ChainTracer tracer(scene, from, work.stats);
    static const SeedPhotons kNone;
    ChainSeeds seeds(scene, from, lamp, depth, limits.photons ? *limits.photons : kNone, tracer,
                     work.stats);
    sampler.seek(Stream::Auxiliary, kTrials | uint64_t(t));
    const auto seed = seeds.draw(sampler);
    if (!seed) return {};
    // Russian roulette before Newton's method by what the path may contribute, and again when that is known.
    // The guess may be far too low where light is focused. The numbers are drawn even where they are not needed, so that the
    // trials do not depend on the threshold.
    constexpr float kLeast = 0.3f, kMargin = 3;
    const float film_weight = std::fabs(z.film_weight);
    const float u_before = sampler.next_1d(), u_after = sampler.next_1d();
    const Rgb f = from.eval_unguided(to_float(seed->w), TransportMode::Radiance).f;
    const float guess = luminance(from.beta * f * seed->guess) / float(lamp.pdf) * film_weight,
                q_guess = std::fmax(kLeast, join_survival(kMargin * guess, limits.threshold));
    if (!(u_before < q_guess)) return {};
    const auto w = tracer.solve(seed->w, seed->events, seed->ray, lamp.target());
    if (!w) {
        ++work.stats.chain_failures;
        return {};
    }
    auto found = evaluate(from, lamp, *w, seed->events, tracer);
    if (!found) return {};
    const RayEnd first = tracer.first();
    found->contribution *= 1 / q_guess;
    const float share = luminance(found->contribution) * float(found->weight) * film_weight,
                q = join_survival(share, limits.threshold);
    if (!(u_after < q)) return {};
    found->contribution *= 1 / q;
    const auto counted =
        count_trials(*found, lamp, seeds, tracer, limits.most_trials, sampler, work);
    if (!counted && limits.gives_up) {
        ++work.stats.runaways;
        return {};
    }
    const uint64_t trials = counted.value_or(limits.most_trials);
    ++work.stats.chains;
    RenderStats::count_trials(trials, work.stats.chains_by_trials);
    if (work.is_observed) record(lamp, *found, tracer, work.pair);
    return Join{.technique = {Strategy::Specular, found->events.count + 1, t},
                .emitter = lamp.emitter,
                .contribution = found->contribution * float(trials),
                .mis_weight = float(found->weight),
                .film = z.film,
                .a = from.ray_end(),
                .b = first,
                .needs_test = false};
}

float hit_beside_specular(const Scene& scene, const SubPath& z, int t, const Emitter& emitter,
                          const TechniqueCounts& counts) {
    const int last = t - 1;
    int from = last - 1;  // the eye vertex before the chain
    while (from > 0 && z[from].is_delta) --from;
    const int events = last - 1 - from;
    if (from == 0 || events == 0 || events > counts.specular_depth) return 1;
    if (!is_left_to_hits(z, from + 1, counts)) return 1;
    const Vertex& end = z[last];
    // Directions of walks are more exact than differences of rounded positions.
    KnownChain chain(scene, z[from].p, Vec3d(-z[from + 1].wo));
    for (int i = from + 1; i < last; ++i)
        if (!chain.pass(z[i], z[i].wo)) return 1;
    const LampPoint lamp = lamp_point(end, emitter, next_event_pmf(z[from], emitter), end.wo);
    const Vertex& first = z[from + 1];
    const double pdf = double(first.pdf_fwd) * double(length2(first.p - z[from].p)) /
                       double(abs_dot(first.ng, first.wo));
    return rest_beside(lamp, chain.ray(), pdf);
}

float hit_lens_beside_specular(const Scene& scene, const SubPath& y, int s,
                               const TechniqueCounts& counts) {
    int from = 1;
    while (from < s && y[from].is_delta) ++from;
    const int events = from - 1;
    if (events == 0 || from >= s || events > counts.specular_depth) return 1;
    // As is_left_to_hits().
    if (counts.merge > 0) return 1;
    for (int i = from; i < s; ++i) {
        const bool is_last = i + 1 == s;
        const bool is_smooth_pair = !y[i].is_delta && (is_last || !y[i + 1].is_delta);
        if (is_smooth_pair && counts.makes_smooth_pairs(is_last)) return 1;
    }
    const Vertex& y0 = y[0];
    KnownChain chain(scene, y[from].p, Vec3d(y[from].wo));
    for (int i = from - 1; i > 0; --i)
        if (!chain.pass(y[i], -y[i + 1].wo)) return 1;
    if (y0.emitter->is_delta()) return 0;
    const LampPoint lamp =
        lamp_point(y0, *y0.emitter, next_event_pmf(y[from], *y0.emitter, counts.guide), -y[1].wo);
    return rest_beside(lamp, chain.ray(),
                       double(y[from - 1].pdf_rev) / double(y[from].to_predecessor));
}

}  // namespace etendue
