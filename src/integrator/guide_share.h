#pragma once
// What guided walks have to find: the light that no other technique finds more easily.

#include "pathspace/mis.h"

namespace etendue {

/// Share of what arrives at the connectible v_i of a walk in `mode` from v_{i-1} that walks in the other mode find by this
/// direction, rather than by the join of the two vertices: h² / (h² + c²), the power heuristic of the techniques that reach
/// v_{i-1} from v_i, by the BSDF alone, against the join. At y_1, these are hits against next events. Techniques with more
/// vertices of this walk do not count: densities of walks that have no guide yet say little of those that will have one. With
/// connections, the walk must have sums of weights [mis.h] for `n`.
template <TransportMode mode>
float share_of_walks(const SubPath& path, int i, const TechniqueCounts& n) {
    constexpr Side side = mode == TransportMode::Importance ? Side::Light : Side::Eye;
    if (i > 1 && n.connect == 0) return 1;
    const Vertex& v = path[i];
    // Where the walk ended here, the other would have come from where its last ray went, or from above.
    const bool has_flight = path.flight.pdf_sa > 0 && !v.is_delta;
    const Vec3 away = i + 1 < path.size() ? direction(v, path[i + 1])
                      : has_flight        ? path.flight.d
                                          : facing_normal(v);
    const Vertex& from = path[i - 1];
    const double rev = double(v.eval_unguided(away, mode).pdf_rev) * double(v.to_predecessor);
    if (!(rev > 0)) return 0;
    constexpr int edges = 1 << 30;
    const double walks =
        sqr(rev / double(from.pdf_fwd)) *
        (squares_at<side>(path, i - 1, from.is_delta, rev, gloss(v, false), edges, n) +
         v.weight_sum);
    return walks > 0 ? float(walks / (walks + split_squares<side>(path, i, false, 0, n))) : 0.0f;
}

}  // namespace etendue
