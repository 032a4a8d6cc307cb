#include "mcmc/mutation/eye_chain.h"

#include <algorithm>
#include <cmath>

#include "mcmc/addresses.h"

namespace etendue {
namespace {

/// Of directions at vertices between two chains [Veach 1997, §11.4.4]. Veach has 1e-4; but angles this small cannot be
/// computed from the vertices.
constexpr float kDegree = kPi / 180;
constexpr LogRange kTurns{1e-3f * kDegree, 0.1f * kDegree};

/// Direction of the ray from a surface that meets another vertex. It begins beside the surface, by more than the smallest
/// angles where coordinates are large.
Vec3 aim(const Vertex& from, const Vertex& to) {
    const Vec3 d = direction(from, to);
    return to.is_infinite ? d : normalize(to.p - offset_origin(from.ray_end(), d));
}

/// Density of y_{i-1} from y_i, if the direction to x_{i-1} was turned by an angle whose logarithm is uniform; up to a
/// constant.
double turned_density(const PathState& x, const PathState& y, int i) {
    const Vertex& at = y[i].v;
    const Vec3 difference = aim(at, y[i - 1].v) - aim(at, x[i - 1].v);
    const float angle = 2 * std::asin(std::min(0.5f * length(difference), 1.0f));
    if (!kTurns.contains(angle)) return 0;
    return y.geometry_from_eye(i - 1) / double(angle * std::sin(angle));
}

}  // namespace

EyeChainMutation::EyeChainMutation(Kind kind, const PathMeasure& measure)
    : kind_(kind), events_(kind == Kind::Glossy ? Followed::Glossy : Followed::Delta),
      range_(film_range(measure)) {}

EyeChainMutation::Role EyeChainMutation::role(const PathState& x, int i, bool is_glossy) const {
    // A glossy reflection of the emitter is connected to it, since few such rays would hit it.
    if (is_followed(x, i, events_))
        return i > 1 || x[i].v.is_delta ? Role::RepeatsEvent : Role::IsJoined;
    // Beyond the first glossy reflection, others need not be followed.
    const bool goes_on =
        x[i - 1].v.is_delta || (!is_glossy && i > 1 && is_followed(x, i - 1, events_));
    return goes_on ? Role::TurnsDirection : Role::IsJoined;
}

EyeChainMutation::Chains EyeChainMutation::chains(const PathState& x) const {
    Chains c{x.last() - 1, 0, false};
    for (; c.end > 0; --c.end) {
        const Role at_end = role(x, c.end, c.is_glossy);
        if (at_end == Role::IsJoined) break;
        c.turns += at_end == Role::TurnsDirection;
        c.is_glossy |= at_end == Role::RepeatsEvent && !x[c.end].v.is_delta;
    }
    return c;
}

bool EyeChainMutation::suits(const PathState& x) const {
    const Chains c = chains(x);
    if (c.end == 0 && x.emitter().is_delta()) return false;
    return kind_ == Kind::Glossy ? c.is_glossy : (c.turns > 0) == (kind_ == Kind::MultiChain);
}

bool EyeChainMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                               MutationWay& way) const {
    const int k = x.last(), end = chains(x).end;
    way = {.l = end - 1, .m = k, .m_y = k};
    c.sampler.seek(Stream::Selection, addresses::kPart);
    const float r = range_.sample(c.sampler.next_1d());
    const float azimuth = 2 * kPi * c.sampler.next_1d();
    PathBuilder builder = c.builder(&x, end - 1, k);
    if (!builder.start_eye({x.film.x + r * std::cos(azimuth), x.film.y + r * std::sin(azimuth)}))
        return false;
    for (int i = k - 1; i > end; --i) {
        const Vertex& at = builder.eye_end();
        std::optional<BsdfSample> s;
        if (is_followed(x, i, events_)) {
            s = follow(at, x, i, TransportMode::Radiance);
        } else if (at.is_connectible) {
            c.sampler.seek(Stream::Selection, addresses::kTurn + uint64_t(i));
            const float angle = kTurns.sample(c.sampler.next_1d());
            // Toward the old vertex: the old direction would miss it by as much as x_i moves.
            s = given(turned(aim(at, x[i - 1].v), angle, c.sampler.next_1d()));
        }
        if (!s || !builder.step_eye(*s)) return false;
    }
    return builder.finish(y);
}

PathDensity EyeChainMutation::Q(const PathState& x, const PathState& y,
                                const MutationWay& way) const {
    if (way.l < 0 && y.emitter().is_delta()) return 0;  // The chain cannot hit it.
    const int k = y.last();
    // On the way back, the same events must be followed.
    if (chains(y).end != way.l + 1) return 0;
    for (int i = k - 1; i > std::max(way.l, 0); --i)
        if (!is_same_event(x, y, i, events_)) return 0;
    // Film points and half vectors have the same density in both directions.
    PathDensity p = y.eye(k - 1);
    for (int i = k - 1; i > way.l + 1; --i)
        p *= is_followed(y, i, events_) ? followed_density(y, i, TransportMode::Radiance)
                                        : turned_density(x, y, i);
    return p;
}

}  // namespace etendue
