#pragma once
// Unbiased estimates of 1/p_c, the reciprocal of the probability that a walk leaves a vertex and finds a partner within a
// sphere, by Bernoulli trials [Booth 2007; Qin et al. 2015, §3].

#include "pathspace/subpath.h"

namespace etendue {

/// Whether two vertices form a pair: the one predicate of gathers and trials.
inline bool is_near(Vec3 a, Vec3 b, float radius2) {
    return length2(a - b) < radius2;
}

/// What the pair's dropped vertex was sampled from, and where its partner may lie.
struct PairEvent {
    const Vertex&
        from;  ///< z_{t-2} in mode Radiance, or y_{s-2} in mode Importance, which may be y_0.
    TransportMode mode;
    Vec2 u_emission;  ///< That y_0 was made from; read only if `from` is y_0.
    Vec3 center;      ///< The vertex that stays.
    float radius;
};

/// r with E[r] = 1/p_c, p_c the probability that the walk goes on from `from` and its next vertex forms a pair with the
/// centre by a smooth event. It needs N trials of a proposal that holds the whole event: r = N / (q·mass). The proposal
/// with the smallest mass is taken; there is no cap. `sampler` stands at numbers that belong to this pair alone.
double reciprocal_probability(const Scene& scene, const PairEvent& event, Sampler& sampler,
                              Vertex& scratch, RenderStats& stats);

}  // namespace etendue
