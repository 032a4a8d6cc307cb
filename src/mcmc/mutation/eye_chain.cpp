#include "mcmc/mutation/eye_chain.h"

#include <cmath>

namespace etendue {
namespace {

/// Of directions at vertices between two chains [Veach 1997, §11.4.4].
constexpr float kDegree = kPi / 180;
constexpr LogRange kTurns{1e-4f * kDegree, 0.1f * kDegree};

}  // namespace

EyeChainMutation::EyeChainMutation(Kind kind, const PathMeasure& measure)
    : is_multi_(kind == Kind::MultiChain), range_(film_range(measure)) {}

EyeChainMutation::Chains EyeChainMutation::chains(const PathState& x) {
    Chains c{x.last() - 1, 0};
    while (true) {
        while (c.end > 0 && x[c.end].v.is_delta) --c.end;
        if (c.end == 0 || !x[c.end - 1].v.is_delta) return c;
        ++c.turns;
        --c.end;
    }
}

bool EyeChainMutation::suits(const PathState& x) const {
    const Chains c = chains(x);
    const bool can_hit_end = c.end > 0 || !x.emitter().is_delta();
    return can_hit_end && (c.turns > 0) == is_multi_;
}

bool EyeChainMutation::propose(const PathState& x, const MutationContext& c, PathState& y,
                               MutationWay& way) const {
    const int k = x.last(), end = chains(x).end;
    way = {.l = end - 1, .m = k, .m_y = k};
    c.sampler.seek(Stream::Selection, 1);
    const float r = range_.sample(c.sampler.next_1d());
    const float azimuth = 2 * kPi * c.sampler.next_1d();
    PathBuilder builder = c.builder(&x, end - 1, k);
    if (!builder.start_eye({x.film.x + r * std::cos(azimuth), x.film.y + r * std::sin(azimuth)}))
        return false;
    for (int i = k - 1; i > end; --i) {
        const Vertex& like = x[i].v;
        const Vertex& at = builder.eye_end();
        std::optional<BsdfSample> s;
        if (like.is_delta) {
            s = follow(at, like, TransportMode::Radiance);
        } else if (at.is_connectible) {
            c.sampler.seek(Stream::Selection, 2 + uint64_t(i));
            const float angle = kTurns.sample(c.sampler.next_1d());
            s = BsdfSample{.wi = turned(direction(like, x[i - 1].v), angle, c.sampler.next_1d()),
                           .weight = Rgb(1),
                           .pdf = 1,
                           .pdf_rev = 1};
        }
        if (!s || !builder.step_eye(*s)) return false;
    }
    return builder.finish(y);
}

double EyeChainMutation::Q(const PathState&, const PathState& y, const MutationWay& way) const {
    if (way.l < 0 && y.emitter().is_delta()) return 0;  // The chain cannot hit it.
    // Film points and turned directions have the same density in both directions.
    const int k = y.last();
    double p = y[k - 1].eye;
    for (int i = k - 2; i > way.l; --i)
        p *= y[i + 1].v.is_delta ? y[i].eye / double(y[i + 1].eye_pmf) : y.geometry_from_eye(i);
    return p;
}

}  // namespace etendue
