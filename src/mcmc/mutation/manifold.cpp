#include "mcmc/mutation/manifold.h"

#include <cmath>

#include "mcmc/addresses.h"

namespace etendue {
namespace {

/// Rays of Newton's method through a chain. After a small move, more than these hardly ever lead to a solution.
constexpr int kMostRays = 7;

/// The chain between x_m, which moves, and x_l, which stays.
struct Part {
    int l, m;
    bool has_chain() const { return l >= 0 && m - l > 1 && m - l - 1 <= ChainEvents::kMost; }
    /// Whether the lens sees x_m directly. Caustic perturbations then move it at less cost.
    bool is_seen(const PathState& x) const { return m == x.last() - 1; }
    friend bool operator==(const Part&, const Part&) = default;
};

Part part_of(const PathState& x) {
    const auto has_no_event = [](const Vertex& v) { return !v.is_delta; };
    const int m = x.before(x.last(), has_no_event);
    return {m > 0 ? x.before(m, has_no_event) : -1, m};
}

ChainEvents events_of(const PathState& x, const Part& part) {
    ChainEvents events;
    for (int i = part.m - 1; i > part.l; --i) events.add(x[i].v.event);
    return events;
}

ChainTarget target_of(const PathState& x, const Part& part) {
    return {Vec3d(x[part.l].v.p), x[part.l].v.is_infinite};
}

/// Unit vector between two vertices at surfaces.
Vec3d exact_direction(const Vertex& from, const Vertex& to) {
    return normalize(Vec3d(to.p) - Vec3d(from.p));
}

/// The chain of x, whose vertices are rounded.
struct Solution {
    Vec3d w;  ///< Its first direction.
    Passing passing;
    /// Density of the chain's vertices and of x_l, in the measure of paths, if x_m is left in a direction of density 1 per
    /// steradian.
    PathDensity density;
};

std::optional<Solution> solution(const Scene& scene, const PathState& x, const Part& part) {
    const auto& [l, m] = part;
    Solution s{.w = exact_direction(x[m].v, x[m - 1].v), .passing = {}, .density = 1};
    KnownChain chain(scene, x[m].v.p, s.w);
    s.density = x.geometry_from_eye(m - 1) / x.met_from_eye(m - 1);
    for (int i = m - 1; i > l; --i) {
        if (!chain.pass(x[i].v, direction(x[i].v, x[i + 1].v))) return {};
        s.density *= followed_density(x, i, TransportMode::Radiance) / x.met_from_eye(i - 1);
    }
    s.passing = target_of(x, part).passed_by(chain.ray());
    return s;
}

/// The first direction of the chain as the solver finds it: a step of Newton's method squares the error of rounding. Empty where
/// that is too large.
std::optional<Vec3d> refined(const Scene& scene, const PathState& x, const Part& part) {
    constexpr double kRounding = 1e-4;
    const auto s = solution(scene, x, part);
    if (!s) return {};
    const auto [a, b] = s->passing.step();
    if (!(std::hypot(a, b) < kRounding)) return {};
    const TangentBasis basis(s->w);
    return normalize(s->w + basis.s * a + basis.t * b);
}

/// Density of the chain's vertices in the measure of paths, where they are determined by the ends; 0 where it is not known.
PathDensity chain_density(const Scene& scene, const PathState& x, const Part& part) {
    const auto s = solution(scene, x, part);
    if (!s) return 0;
    const Vertex& end = x[part.l].v;
    const double cosine =
        end.is_infinite || !end.has_cosine
            ? 1.0
            : std::fabs(dot(Vec3d(end.ng), Vec3d(direction(end, x[part.l + 1].v))));
    // Of x_l, if x_m is left in a direction of density 1 per steradian.
    const double of_end = s->passing.jacobian() * cosine;
    return of_end > 0 && std::isfinite(of_end) ? s->density / of_end : PathDensity(0);
}

}  // namespace

ManifoldMutation::ManifoldMutation(const PathMeasure& measure)
    : scene_(measure.scene), range_(film_range(measure)) {}

bool ManifoldMutation::suits(const PathState& x) const {
    const Part part = part_of(x);
    if (!part.has_chain() || part.is_seen(x)) return false;
    for (int i = part.l + 1; i < part.m; ++i)
        if (!may_be_in_chain(*x[i].v.shape)) return false;
    return true;
}

bool ManifoldMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                               MutationWay& way) const {
    const int k = x.last();
    const Part part = part_of(x);
    way = {.l = part.l, .m = k, .m_y = k};
    c.sampler.seek(Stream::Selection, addresses::kPart);
    const float r = range_.sample(c.sampler.next_1d());
    const float azimuth = 2 * kPi * c.sampler.next_1d();
    PathBuilder builder = c.builder(&x, part.l, k);
    if (!builder.start_eye({x.film.x + r * std::cos(azimuth), x.film.y + r * std::sin(azimuth)}))
        return false;
    for (int i = k - 1; i > part.m; --i) {
        const auto s = follow(builder.eye_end(), x, i, TransportMode::Radiance);
        if (!s || !builder.step_eye(*s)) return false;
    }
    if (!builder.eye_end().is_connectible) return false;

    const ChainEvents events = events_of(x, part);
    const ChainTarget target = target_of(x, part);
    const Vertex moved = builder.eye_end();
    ChainTracer tracer(scene_, moved, c.chain.work.stats);
    const auto w = tracer.solve(exact_direction(moved, x[part.m - 1].v), events, target, kMostRays);
    if (!w) return false;
    tracer.start(*w);
    for (int i = 0; i < events.count; ++i) {
        if (!tracer.advance() || !tracer.leave(events.number[size_t(i)])) return false;
        builder.append_chain_vertex(tracer.vertex());
    }
    if (!builder.finish(y)) return false;

    // Where the vertices are too coarse to tell the chain, nothing leads back.
    const auto w_new = refined(scene_, y, part), w_old = refined(scene_, x, part);
    if (!w_old || !w_new || !is_same_solution(*w_new, *w)) return false;
    // Back, by the same rule.
    ChainTracer back(scene_, x[part.m].v, c.chain.work.stats);
    const auto again =
        back.solve(exact_direction(x[part.m].v, y[part.m - 1].v), events, target, kMostRays);
    return again && is_same_solution(*again, *w_old);
}

PathDensity ManifoldMutation::Q(const PathState& x, const PathState& y, const MutationWay&) const {
    const int k = y.last();
    const Part part = part_of(y);
    if (!(part == part_of(x))) return 0;
    // Film points have the same density in both directions.
    PathDensity p = y.eye(k - 1);
    for (int i = k - 1; i > part.m; --i) p *= followed_density(y, i, TransportMode::Radiance);
    // The chain has the density 1 in the measure of its ends.
    return p * chain_density(scene_, y, part);
}

}  // namespace etendue
