#pragma once
// Techniques: the ways in which a full path x_0 … x_k (x_0 on the emitter, x_k on the lens) is formed from s light
// vertices and t eye vertices.

#include <array>
#include <cstdint>
#include <limits>

namespace etendue {

class Guide;

enum class Strategy : uint8_t {
    Hit,        ///< C(0,t): the eye path hits an emitter.
    NextEvent,  ///< C(1,t), t ≥ 2: a point sampled on an emitter for z_{t-1}.
    Connect,    ///< C(s,t), s ≥ 2, t ≥ 2; for s = 1, with y_0 of a light path.
    Splat,  ///< C(s,1): the light path is connected to the lens. Methods with hits do not use C(1,1).
    HitLens,   ///< C(s,0): the light path hits a finite lens.
    Merge,     ///< M(s,t): y_{s-1} and z_{t-1}, near each other, are treated as one vertex.
    Gather,    ///< U(s,t): one vertex of such a pair is dropped; a shadow ray connects the rest.
    Specular,  ///< X(s,t): s-1 delta events between y_0 and z_{t-1}, found by Newton's method.
};

/// Whether y_{s-1} and z_{t-1} stand for one vertex of the full path.
constexpr bool is_pair(Strategy strategy) {
    return strategy == Strategy::Merge || strategy == Strategy::Gather;
}

/// Whether the light vertices are others than those of the sample's light path (Workspace::light_side()).
constexpr bool has_own_light_side(Strategy strategy) {
    return is_pair(strategy) || strategy == Strategy::Specular;
}

struct Technique {
    Strategy strategy;
    int s, t;
    bool drops_eye = false;  ///< For gathers: whether z_{t-1} is dropped instead of y_{s-1}.

    /// Number of vertices of the full path.
    int vertices() const { return s + t - is_pair(strategy); }
    friend bool operator==(const Technique&, const Technique&) = default;
};

/// The technique that joins s light and t eye vertices without pairs.
constexpr Technique connection_technique(int s, int t) {
    return {t == 0   ? Strategy::HitLens
            : t == 1 ? Strategy::Splat
            : s == 0 ? Strategy::Hit
            : s == 1 ? Strategy::NextEvent
                     : Strategy::Connect,
            s, t};
}

/// The vertex of a pair that is dropped if either one can be dropped [Qin et al. 2015, appendix B and table 2].
enum class PairRule : uint8_t {
    Gloss,  ///< The one sampled from the less glossy vertex; z_{t-1} if both are equal.
    Eye,    ///< z_{t-1}.
    Light,  ///< y_{s-1}.
    Both,   ///< Each of them in turn, which makes two paths.
};

/// Whether the technique joins two sub-paths inside the scene: neither a hit of an emitter, nor a splat, nor a hit of
/// the lens [Popov et al. 2015].
constexpr bool is_inner(const Technique& q) {
    return q.s >= 1 && q.t >= 2;
}

/// The paths that an image shows.
struct PathSelection {
    static constexpr int kNoLimit = std::numeric_limits<int>::max();

    bool inner_only = false;  ///< Only contributions of inner techniques, see is_inner().
    int shortest = 1, longest = kNoLimit;  ///< Path lengths, in edges.

    bool contains(const Technique& q) const {
        const int edges = q.vertices() - 1;
        return edges >= shortest && edges <= longest && (!inner_only || is_inner(q));
    }
    bool contains_all() const { return !inner_only && shortest <= 1 && longest == kNoLimit; }
};

/// Pairs of light and eye vertices near each other.
struct PairModel {
    /// π d², the area of the disc in which the partners of an eye vertex fixed by the film point (Vertex) are searched.
    float disc = 0;
    float inner_disc = 0;  ///< The same for other eye vertices.
    int min_edges = 2;     ///< Length, in edges, of the shortest paths made from pairs.
    /// Least m of an x_m where vertices are merged. 2: next events make all direct light, with less noise.
    int first_merge = 1;
    PairRule rule = PairRule::Gloss;
    /// Whether weights clamp probabilities to 1 [Qin et al. 2015, eq. 24]. An estimator that divides by them does not.
    bool clamps = true;

    float disc_of(bool is_fixed_by_film) const { return is_fixed_by_film ? disc : inner_disc; }
    /// Approximate probability of finding a pair whose dropped vertex has the area density `pdf` [ibid., eq. 24].
    double probability(double pdf, bool is_fixed_by_film) const {
        const double p = double(disc_of(is_fixed_by_film)) * pdf;
        return clamps && p > 1 ? 1 : p;
    }

    friend bool operator==(const PairModel&, const PairModel&) = default;
};

extern const std::array<float, 256> kPairShares;
/// Share of the pairs of a vertex that the weights count, since these pairs share the eye path: 2^(-level/16), where
/// level is Vertex::pair_level.
inline double pair_share(uint8_t level) {
    return double(kPairShares[level]);
}
/// The level whose share is nearest to `share`, in (0, 1].
uint8_t pair_level_of_share(double share);

/// Number of samples of each strategy, 0 for strategies that an algorithm does not use. Eye densities are per pixel, so
/// techniques of one eye path per pixel count 1, and those that reach any pixel count N_L, the number of light paths.
struct TechniqueCounts {
    float hit = 0, next_event = 0, connect = 0, splat = 0, hit_lens = 0;
    float connect_emission = 0;  ///< C(1,t) with y_0 of light paths, Strategy::Connect.
    /// Next events at an eye vertex fixed by the film point (Vertex), for each of `next_event` at another vertex. The
    /// vertex is not a random choice, so that they count as that many samples.
    float repeated_next_event = 1;
    float merge = 0,
          gather = 0;  ///< For each inner vertex of the path; at least one of the two is 0.
    PairModel pairs{};
    /// Probability with which an eye walk continues past the first vertex where it chooses a direction at random, the
    /// last one fixed by the film point (Vertex). The techniques beyond count this share of a sample. 1 where there are
    /// gathers.
    float continued = 1;
    const Guide* guide = nullptr;  ///< Guide of both walks; nullptr if they have none.
    int specular_depth = 0;  ///< Most delta events of X(s,t); 0 where there is no such technique.

    friend bool operator==(const TechniqueCounts&, const TechniqueCounts&) = default;
    bool uses_light_paths() const {
        return connect + connect_emission + splat + hit_lens + merge + gather > 0;
    }
    bool uses_pairs() const { return merge > 0 || gather > 0; }
    /// Whether a technique other than hits makes all paths with two neighbouring vertices that scatter by smooth lobes;
    /// `at_lens`: whether one of the two is the lens instead.
    bool makes_smooth_pairs(bool at_lens) const {
        return at_lens ? splat > 0 : connect > 0 || gather > 0;
    }
    /// Number of gathers at each inner vertex of a path of `edges` edges.
    float gathers(int edges) const { return edges < pairs.min_edges ? 0.0f : gather; }
    /// Count of gathers in MIS weights at an x_m of this level. All pairs of an eye vertex share its eye path. If the film
    /// point fixes x_m (Vertex), this eye path contains no random choice, and the pairs count in full.
    double weighed_gathers(uint8_t pair_level, bool is_fixed_by_film, int edges) const {
        return double(gathers(edges)) * (is_fixed_by_film ? 1 : pair_share(pair_level));
    }
    /// Count of merges in MIS weights at such an x_m, times the area of the disc.
    double merge_area(uint8_t pair_level, bool is_fixed_by_film) const {
        return is_fixed_by_film ? double(merge) * double(pairs.disc)
                                : double(merge) * pair_share(pair_level) *
                                      double(pairs.inner_disc) * double(continued);
    }
    /// Number of eye sub-paths, of one sample, that reach a vertex.
    float reaching(bool is_fixed_by_film) const { return is_fixed_by_film ? 1 : continued; }
    /// Number of next events of one sample that are made for a vertex.
    float next_events(bool is_fixed_by_film) const {
        return next_event * (is_fixed_by_film ? repeated_next_event : continued);
    }
    float of(const Technique& q) const {
        switch (q.strategy) {
        case Strategy::Hit: return hit;
        case Strategy::NextEvent: return next_event;
        case Strategy::Connect: return q.s == 1 ? connect_emission : connect;
        // On a path of one edge, the only random choices of a hit are the lens point and the film point. Splats would
        // only add noise.
        case Strategy::Splat: return q.s == 1 && hit > 0 ? 0 : splat;
        case Strategy::HitLens: return hit_lens;
        case Strategy::Merge: return merge;
        case Strategy::Gather: return gathers(q.vertices() - 1);
        case Strategy::Specular: return q.s >= 2 && q.s - 1 <= specular_depth ? 1 : 0;
        }
        return 0;
    }
};

}  // namespace etendue
