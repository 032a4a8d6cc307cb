#pragma once
// Multiple importance sampling weights over all techniques that can make a path: the power heuristic with β = 2
// [Veach 1997, §9.2, §10.2], in constant time per join.
//
// With the light and eye densities p_L(x_i), p_E(x_i) of every vertex, the density of the technique whose split lies
// before x_i (i light vertices) is  p_i = Π_{j<i} p_L(x_j) · Π_{j≥i} p_E(x_j).  Moving the split past a vertex multiplies by
// a ratio, so relative to the present split the sum over all others is, on each side, a nested product
//     S_L = ρ_L² (c_L² + ρ_{L-1}² (c_{L-1}² + … )),     ρ_i = pdf_rev_i / pdf_fwd_i,
// where c_i is the number of samples of the technique whose split lies between v_{i-1} and v_i, 0 where an event there
// is a delta event. Everything but the last two levels is known while the sub-path is walked: v[L].weight_sum holds
// the sum inside from level L-2 on. `path_pdfs.h` has the same weight as an explicit sum; a test holds them together.

#include "math/vec.h"
#include "pathspace/technique.h"
#include "pathspace/vertex.h"

namespace etendue {

enum class Side : uint8_t { Light, Eye };

/// c_i of a sub-path: samples of the technique split between v[i-1] and v[i], times the ratio of its own density to the
/// walk's where it samples y_0 in another way. `delta` tells whether the event at v[i] is one.
template <Side side>
inline double split_count(const SubPath& v, int i, bool delta, const TechniqueCounts& n) {
    if constexpr (side == Side::Light) {
        if (i == 0) return v[0].emitter->is_delta() ? 0.0 : n.hit;
        if (delta) return 0;
        if (i == 1) return double(n.next_event) * v[1].next_event_ratio;
    } else {
        if (i == 0) return n.hit_lens;
        if (delta) return 0;
        if (i == 1) return n.splat;
    }
    return v[i - 1].is_delta ? 0.0 : n.connect;
}

/// Sum over the techniques that move the split past v[last], relative to the present one. `rev_last`, `rev_prev`:
/// densities of v[last] and v[last-1] as sampled from the other side.
template <Side side>
inline double outward_sum(const SubPath& v, int last, bool last_is_delta, double rev_last,
                          double rev_prev, const TechniqueCounts& n) {
    double inner = sqr(split_count<side>(v, last, last_is_delta, n));
    if (last >= 1) {
        const double prev =
            sqr(split_count<side>(v, last - 1, v[last - 1].is_delta, n)) + v[last].weight_sum;
        inner += sqr(rev_prev / v[last - 1].pdf_fwd) * prev;
    }
    return sqr(rev_last / v[last].pdf_fwd) * inner;
}

/// The sum from level i on, stored at v[i+2] once v[i].pdf_rev is known; `below` is that of level i-1.
template <Side side>
inline double level_sum(const SubPath& v, int i, double below, const TechniqueCounts& n) {
    return sqr(double(v[i].pdf_rev) / v[i].pdf_fwd) *
           (sqr(split_count<side>(v, i, v[i].is_delta, n)) + below);
}

/// Power heuristic of a technique with `count` samples against the sum of the others' (n·p)², relative to its p.
inline float power_heuristic(double count, double others) {
    return float(sqr(count) / (sqr(count) + others));
}

}  // namespace etendue
