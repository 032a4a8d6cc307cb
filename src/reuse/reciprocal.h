#pragma once
// Unbiased estimates of 1/p_c by Bernoulli trials [Booth 2007; Qin et al. 2015, §3]. p_c is the probability that the
// next vertex of a walk lies near a given vertex.

#include "pathspace/walk.h"
#include "reuse/arrival_side.h"

namespace etendue {

/// The region of a vertex's partners: the part of a ball around it within `half_height` of its tangent plane, on its
/// side of the surface if that is opaque. Gathers and trials use the same predicate.
struct Neighbourhood {
    Vec3 p, n;  ///< The vertex and its geometric normal.
    ArrivalSide side;
    float radius, half_height;

    /// Whether a partner at `q` that arrived on side `arrival` lies in the neighbourhood.
    bool contains(Vec3 q, ArrivalSide arrival) const {
        const Vec3 v = q - p;
        return length2(v) < sqr(radius) && std::fabs(dot(v, n)) <= half_height &&
               side.admits(arrival);
    }
    /// Sets the ray's end where it leaves the neighbourhood; false where it misses it.
    bool clip(Ray& ray) const;
};

/// Directions proposed by trials.
enum class TrialBound : uint8_t {
    Box,  ///< A box of random numbers that holds the ball [Qin et al. 2015, supplement]; for diffuse vertices.
    Cone,  ///< The cone that holds the ball.
    Slab,  ///< The part of the tangent plane through which all of a flat neighbourhood is seen, or the cone.
};

/// The event from which the pair's dropped vertex was sampled, and the neighbourhood of the kept vertex.
struct PairEvent {
    const Vertex&
        from;  ///< z_{t-2} in mode Radiance, or y_{s-2} in mode Importance, which may be y_0.
    TransportMode mode;
    Neighbourhood near;  ///< Of the vertex that is kept.
    TrialBound bound = TrialBound::Slab;
};

/// r with E[r] = 1/p_c, where p_c is the probability that the walk continues from `from` by a smooth event and its next
/// vertex lies in the neighbourhood. N trials of a proposal that contains the whole event give r = N / (q·mass), where
/// q is the survival of roulette at `from`. The proposal with the smallest mass is chosen. `sampler` must be positioned
/// at numbers used by this pair only. Returns 0 after ten million failed trials, due to a defect or an almost
/// unreachable neighbourhood; RenderStats::runaways counts these.
double reciprocal_probability(const Scene& scene, const PairEvent& event, Sampler& sampler,
                              Vertex& scratch, RenderStats& stats);

}  // namespace etendue
