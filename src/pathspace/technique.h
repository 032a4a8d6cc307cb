#pragma once
// Techniques: the ways in which a full path x_0 … x_k (x_0 on the emitter, x_k on the lens) can be put together from s
// light vertices and t eye vertices.

#include <cstdint>

namespace etendue {

enum class Strategy : uint8_t {
    Hit,        ///< C(0,t): the eye path lands on an emitter.
    NextEvent,  ///< C(1,t), t ≥ 2: a point chosen on an emitter for z_{t-1}.
    Connect,    ///< C(s,t), s ≥ 2, t ≥ 2.
    Splat,      ///< C(s,1): the light path is connected to the lens.
    HitLens,    ///< C(s,0): the light path lands on a finite lens.
    Merge,      ///< M(s,t): y_{s-1} and z_{t-1}, near each other, are taken for one vertex.
    Gather,     ///< U(s,t): such a pair, one of the two dropped, the rest joined by a shadow ray.
};

/// Whether y_{s-1} and z_{t-1} stand for one vertex of the full path.
constexpr bool is_pair(Strategy strategy) {
    return strategy == Strategy::Merge || strategy == Strategy::Gather;
}

struct Technique {
    Strategy strategy;
    int s, t;

    /// Of the full path.
    int vertices() const { return s + t - is_pair(strategy); }
    friend bool operator==(const Technique&, const Technique&) = default;
};

/// The technique that joins s light to t eye vertices by connections alone.
constexpr Technique connection_technique(int s, int t) {
    return {t == 0   ? Strategy::HitLens
            : t == 1 ? Strategy::Splat
            : s == 0 ? Strategy::Hit
            : s == 1 ? Strategy::NextEvent
                     : Strategy::Connect,
            s, t};
}

/// How many samples of each strategy an algorithm takes per eye sub-path, 0 for those it does not run. Eye densities are
/// per pixel, so one eye path a pixel counts 1 and whatever reaches any pixel counts N_L, the number of light paths.
struct TechniqueCounts {
    float hit = 0, next_event = 0, connect = 0, splat = 0, hit_lens = 0;
    float merge = 0, gather = 0;  ///< Of each inner vertex of the path; one of the two is 0.
    float disc = 0;               ///< π d², the area in which a pair's partner is sought.
    int min_pair_edges = 2;       ///< Shorter paths are not made from pairs.

    bool uses_light_paths() const {
        return connect > 0 || splat > 0 || hit_lens > 0 || merge > 0 || gather > 0;
    }
    float of(Strategy strategy) const {
        switch (strategy) {
        case Strategy::Hit: return hit;
        case Strategy::NextEvent: return next_event;
        case Strategy::Connect: return connect;
        case Strategy::Splat: return splat;
        case Strategy::HitLens: return hit_lens;
        case Strategy::Merge: return merge;
        case Strategy::Gather: return gather;
        }
        return 0;
    }
};

}  // namespace etendue
