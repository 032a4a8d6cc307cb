#pragma once
// Multiple importance sampling weights over all techniques that can make a path: the power heuristic with β = 2
// [Veach 1997, §9.2, §10.2], in constant time per join.
//
// With the light and eye densities p_L(x_i), p_E(x_i) of every vertex, the density of the technique whose split lies
// before x_i (i light vertices) is  p_i = Π_{j<i} p_L(x_j) · Π_{j≥i} p_E(x_j).  Moving the split past a vertex
// multiplies by a ratio, so relative to the present split the sum over all others is, on each side, a nested product
//     S_L = ρ_L² (b_L + ρ_{L-1}² (b_{L-1} + … )),     ρ_i = pdf_rev_i / pdf_fwd_i,
//     b_i = Σ c_i² + m_i²,
// where c_i is the number of samples of a technique whose split lies between v_{i-1} and v_i, 0 where an event there
// is a delta event, and m_i that of pairs at v_i, relative to the density of this split. All levels except the last two
// are known during the walk: v[L].weight_sum is the inner sum from level L-2 on. `path_pdfs.h` defines the same weight
// as an explicit sum; tests compare the two.

#include "math/vec.h"
#include "pathspace/gloss.h"
#include "pathspace/technique.h"
#include "pathspace/vertex.h"

namespace etendue {

enum class Side : uint8_t { Light, Eye };

/// `is_delta`: whether the path's event at the vertex is a delta event.
inline uint8_t gloss(const Vertex& v, bool is_delta) {
    if (v.kind == Vertex::Kind::Sensor) return kLensGloss;
    return is_delta ? kDeltaGloss : v.gloss;
}

/// Σ c² of the techniques C(1,t), relative to p_L(y_0); `is_fixed_by_film`: of z_{t-1}.
inline double emission_squares(double next_event_ratio, bool is_fixed_by_film,
                               const TechniqueCounts& n) {
    return sqr(n.next_events(is_fixed_by_film) * next_event_ratio) +
           sqr(double(n.connect_emission * n.reaching(is_fixed_by_film)));
}

/// Σ c_i² of a sub-path over the techniques split between v[i-1] and v[i]: their samples, times the ratio of their own
/// density to the walk's where they sample y_0 in another way. `delta` tells whether the event at v[i] is one, `inward`
/// is the gloss of the vertex beyond v[i].
template <Side side>
inline double split_squares(const SubPath& v, int i, bool delta, uint8_t inward,
                            const TechniqueCounts& n) {
    if constexpr (side == Side::Light) {
        if (delta && i > 0) return 0;
        // The eye sub-path ends at v[i].
        const double reaching = sqr(double(n.reaching(inward == kLensGloss)));
        if (i == 0) return v[0].emitter->is_delta() ? 0.0 : reaching * sqr(double(n.hit));
        if (i == 1) return emission_squares(v[1].next_event_ratio, inward == kLensGloss, n);
        return v[i - 1].is_delta ? 0.0 : reaching * sqr(double(n.connect));
    } else {
        if (i == 0) return sqr(double(n.hit_lens));
        if (delta) return 0;
        if (i == 1) return sqr(double(n.splat));
        return v[i - 1].is_delta ? 0.0
                                 : sqr(double(n.connect * n.reaching(v[i - 1].is_fixed_by_film)));
    }
}

/// m_i² of a sub-path, for the inner vertex v[i] of a path: n·p of a merge is N_L π d² p_L(x_m) p_E(x_m) times the
/// densities of all others. A gather leaves the dropped vertex's density out and has the probability of its disc
/// instead. `rev`: density of v[i] from the other side; `inward`: gloss of the vertex beyond v[i].
template <Side side>
inline double pair_squares(const SubPath& v, int i, double rev, uint8_t inward, int edges,
                           const TechniqueCounts& n) {
    if (i == 0 || !v[i].is_connectible || edges < n.pairs.min_edges) return 0;
    const double fwd = v[i].pdf_fwd;
    constexpr bool eye = side == Side::Eye;
    // The film point fixes a light vertex only next to the lens: no technique splits a path beside a delta event.
    const bool is_fixed_by_film = eye ? v[i].is_fixed_by_film : inward == kLensGloss;
    if (n.merge > 0) {
        if ((eye ? edges - i : i) < n.pairs.first_merge) return 0;
        return sqr(n.merge_area(v[i].pair_level, is_fixed_by_film) * fwd);
    }
    const uint8_t outward = gloss(v[i - 1], v[i - 1].is_delta);
    const uint8_t before = eye ? inward : outward, after = eye ? outward : inward;
    double sum = 0;
    if (drops(n.pairs.rule, eye, before, after))
        sum += sqr(n.pairs.probability(fwd, is_fixed_by_film));
    if (rev > 0 && drops(n.pairs.rule, !eye, before, after))
        sum += sqr(n.pairs.probability(rev, is_fixed_by_film) * (fwd / rev));
    return sum > 0 ? sum * sqr(n.weighed_gathers(v[i].pair_level, is_fixed_by_film, edges)) : 0;
}

/// b_i of a sub-path. `delta`, `rev`, `inward` as above; `edges`: length of the path, or any larger number.
template <Side side>
inline double squares_at(const SubPath& v, int i, bool delta, double rev, uint8_t inward, int edges,
                         const TechniqueCounts& n) {
    double b = split_squares<side>(v, i, delta, inward, n);
    if (n.uses_pairs() && !delta) b += pair_squares<side>(v, i, rev, inward, edges, n);
    return b;
}

/// The other side of a join, seen from the last vertex of one side.
struct Across {
    double rev_last, rev_prev;  ///< Densities of v[last], v[last-1] as sampled from the other side.
    uint8_t gloss = 0;          ///< Of the next vertex.
    int edges = 0;              ///< Length of the whole path.
};

/// Sum over the techniques that move the split past v[last], relative to the present one.
template <Side side>
inline double outward_sum(const SubPath& v, int last, bool last_is_delta, const Across& a,
                          const TechniqueCounts& n) {
    double inner = squares_at<side>(v, last, last_is_delta, a.rev_last, a.gloss, a.edges, n);
    if (last >= 1) {
        const uint8_t inward = gloss(v[last], last_is_delta);
        const double prev =
            squares_at<side>(v, last - 1, v[last - 1].is_delta, a.rev_prev, inward, a.edges, n) +
            v[last].weight_sum;
        inner += sqr(a.rev_prev / v[last - 1].pdf_fwd) * prev;
    }
    return sqr(a.rev_last / v[last].pdf_fwd) * inner;
}

/// The sum from level i on, stored at v[i+2] as soon as v[i].pdf_rev is known; `below` is that of level i-1.
template <Side side>
inline double level_sum(const SubPath& v, int i, double below, const TechniqueCounts& n) {
    constexpr int edges = 1 << 30;  // Paths with a vertex beyond v[i+1] have at least three edges.
    const double rev = v[i].pdf_rev;
    const uint8_t inward = gloss(v[i + 1], v[i + 1].is_delta);
    return sqr(rev / v[i].pdf_fwd) *
           (squares_at<side>(v, i, v[i].is_delta, rev, inward, edges, n) + below);
}

/// Power heuristic of a technique with `count` samples against the sum of the others' (n·p)², relative to its p.
inline float power_heuristic(double count, double others) {
    return float(sqr(count) / (sqr(count) + others));
}

}  // namespace etendue
