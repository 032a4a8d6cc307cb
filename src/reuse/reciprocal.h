#pragma once
// Unbiased estimates of 1/p_c, the reciprocal of the probability that a walk leaves a vertex and finds a partner near
// another, by Bernoulli trials [Booth 2007; Qin et al. 2015, §3].

#include "pathspace/walk.h"
#include "reuse/arrival_side.h"

namespace etendue {

/// Where the partners of a vertex lie: the part of a ball about it that is at most `half_height` away from its tangent
/// plane, on its own side of the surface if light does not pass through. The one predicate of gathers and trials.
struct Neighbourhood {
    Vec3 p, n;  ///< The vertex and its geometric normal.
    ArrivalSide side;
    float radius, half_height;

    /// `arrival`: of the partner, at `q`.
    bool contains(Vec3 q, ArrivalSide arrival) const {
        const Vec3 v = q - p;
        return length2(v) < sqr(radius) && std::fabs(dot(v, n)) <= half_height &&
               side.admits(arrival);
    }
    /// Sets the ray's end where it leaves the neighbourhood; false where it misses it.
    bool clip(Ray& ray) const;
};

/// Which directions trials propose.
enum class TrialBound : uint8_t {
    Box,  ///< A box of random numbers that holds the ball [Qin et al. 2015, supplement]; for diffuse vertices.
    Cone,  ///< The cone that holds the ball.
    Slab,  ///< The part of the tangent plane through which all of a flat neighbourhood is seen, or the cone.
};

/// What the pair's dropped vertex was sampled from, and where its partner may lie.
struct PairEvent {
    const Vertex&
        from;  ///< z_{t-2} in mode Radiance, or y_{s-2} in mode Importance, which may be y_0.
    TransportMode mode;
    Neighbourhood near;  ///< Of the vertex that stays.
    TrialBound bound = TrialBound::Slab;
};

/// r with E[r] = 1/p_c, p_c the probability that the walk goes on from `from` and its next vertex lies in the
/// neighbourhood, found by a smooth event. It needs N trials of a proposal that holds the whole event:
/// r = N / (q·mass). The proposal with the smallest mass is taken. `sampler` stands at numbers that belong to this pair
/// alone. A pair whose trials fail ten million times counts as 0: a defect, or a neighbourhood that is hardly ever met. A run
/// reports how many there were (RenderStats::runaways).
double reciprocal_probability(const Scene& scene, const PairEvent& event, Sampler& sampler,
                              Vertex& scratch, RenderStats& stats);

}  // namespace etendue
