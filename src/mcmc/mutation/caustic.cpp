#include "mcmc/mutation/caustic.h"

#include <algorithm>
#include <cmath>

#include "mcmc/addresses.h"

namespace etendue {

CausticMutation::CausticMutation(Followed events, const PathMeasure& measure)
    : events_(events), measure_(measure), film_(film_range(measure)) {}

int CausticMutation::first(const PathState& x) const {
    int i = x.last() - 2;
    while (i > 0 && is_followed(x, i, events_)) --i;
    return i;
}

bool CausticMutation::suits(const PathState& x) const {
    const int k = x.last();
    if (x[k - 1].v.is_delta) return false;
    if (events_ == Followed::Delta) return true;
    const int l = first(x);
    for (int i = l + 1; i < k - 1; ++i)
        if (!x[i].v.is_delta) return true;
    return false;
}

LogRange CausticMutation::range(const PathState& x, int first) const {
    constexpr float kLargestAngle = 1;
    const int k = x.last();
    const Vertex &lens = x[k].v, &seen = x[k - 1].v;
    // Distance that x_{k-1} moves if the film point moves by one pixel; pdf_direction() is per pixel.
    const float pdf_dir = measure_.scene.sensor().pdf_direction(lens.p, direction(lens, seen));
    const float distance = lens.is_infinite ? 1.0f : length(seen.p - lens.p);
    float a_pixel = distance / std::sqrt(pdf_dir);
    if (!x[first].v.is_infinite) {
        float path = 0;
        for (int i = first; i < k - 1; ++i) path += length(x[i + 1].v.p - x[i].v.p);
        a_pixel = std::min(a_pixel / path, kLargestAngle / film_.high);
    }
    return {film_.low * a_pixel, film_.high * a_pixel};
}

bool CausticMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                              MutationWay& way) const {
    const int k = x.last(), l = first(x);
    way = {.l = l, .m = k, .m_y = k};
    c.sampler.seek(Stream::Selection, addresses::kPart);
    way.angle = range(x, l).sample(c.sampler.next_1d());
    const float u = c.sampler.next_1d();
    PathBuilder builder = c.builder(&x, l, k);
    const Vertex& from = x[l].v;
    const Vec3 old = direction(from, x[l + 1].v);
    if (l > 0) {
        if (!builder.step_light(given(turned(old, way.angle, u)))) return false;
    } else {
        const Emitter& emitter = x.emitter();
        EmissionSample e{.p = from.p,
                         .ng = from.ng,
                         .d = old,
                         .Le = Rgb(1),
                         .pdf_y0 = 1,
                         .pdf_d = 1,
                         .uv = from.uv,
                         .prim = from.location.prim};
        if (from.is_infinite) {
            const Frame frame = Frame::from_normal(from.p);
            const float azimuth = 2 * kPi * u;
            e.p = x[1].v.p + from.p * (2 * emitter.disc().radius) +
                  (frame.s * std::cos(azimuth) + frame.t * std::sin(azimuth)) * way.angle;
        } else {
            e.d = turned(old, way.angle, u);
        }
        if (!builder.start_light(emitter, e)) return false;
    }
    for (int i = l + 1; i < k - 1; ++i) {
        const auto s = follow(builder.light_end(), x, i, TransportMode::Importance);
        if (!s || !builder.step_light(*s)) return false;
    }
    return builder.finish(y);
}

PathDensity CausticMutation::Q(const PathState& x, const PathState& y,
                               const MutationWay& way) const {
    // The logarithm of the angle is uniform over ranges of equal length in both directions, but the ranges differ.
    if (!range(x, way.l).contains(way.angle)) return 0;
    if (first(y) != way.l) return 0;
    for (int i = way.l + 1; i < y.last() - 1; ++i)
        if (!is_same_event(x, y, i, events_)) return 0;
    PathDensity p = y.geometry_from_light(way.l + 1);
    for (int i = way.l + 1; i < y.last() - 1; ++i)
        p *= followed_density(y, i, TransportMode::Importance);
    return p;
}

}  // namespace etendue
