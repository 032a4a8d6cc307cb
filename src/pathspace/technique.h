#pragma once
// Techniques: the ways in which a full path x_0 … x_k (x_0 on the emitter, x_k on the lens) can be put together from s
// light vertices and t eye vertices.

#include <cstdint>
#include <limits>

#include "pathspace/pair_density.h"

namespace etendue {

enum class Strategy : uint8_t {
    Hit,        ///< C(0,t): the eye path lands on an emitter.
    NextEvent,  ///< C(1,t), t ≥ 2: a point chosen on an emitter for z_{t-1}.
    Connect,    ///< C(s,t), s ≥ 2, t ≥ 2; with s = 1, to the y_0 of a light path.
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
    bool drops_eye = false;  ///< Of a gather: z_{t-1} is dropped, else y_{s-1}.

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

/// Which end point of a pair is dropped where either could be [Qin et al. 2015, appendix B and table 2].
enum class PairRule : uint8_t {
    Gloss,  ///< The one that was sampled from the less glossy vertex; z_{t-1} where they are alike.
    Eye,    ///< z_{t-1}.
    Light,  ///< y_{s-1}.
    Both,   ///< Each of them, for a path of its own.
};

/// Whether it joins an eye and a light sub-path inside the scene: neither a hit of an emitter nor light brought to the
/// lens [Popov et al. 2015].
constexpr bool is_inner(const Technique& q) {
    return q.s >= 1 && q.t >= 2;
}

/// Which paths an image shows.
struct PathSelection {
    static constexpr int kNoLimit = std::numeric_limits<int>::max();

    bool inner_only = false;               ///< Only what inner techniques bring, see is_inner().
    int shortest = 1, longest = kNoLimit;  ///< Path lengths, in edges.

    bool contains(const Technique& q) const {
        const int edges = q.vertices() - 1;
        return edges >= shortest && edges <= longest && (!inner_only || is_inner(q));
    }
    bool has_all_lengths() const { return shortest <= 1 && longest == kNoLimit; }
};

/// How many samples of each strategy an algorithm takes per eye sub-path, 0 for those it does not run. Eye densities are
/// per pixel, so one eye path a pixel counts 1 and whatever reaches any pixel counts N_L, the number of light paths.
struct TechniqueCounts {
    float hit = 0, next_event = 0, connect = 0, splat = 0, hit_lens = 0;
    float connect_emission = 0;   ///< C(1,t) with y_0 as light paths sample it, Strategy::Connect.
    float merge = 0, gather = 0;  ///< Of each inner vertex of the path; one of the two is 0.
    float disc = 0;               ///< π d², the area in which a pair's partner is sought.
    int min_pair_edges = 2;       ///< Shorter paths are not made from pairs.
    float short_pair_rate = 1;    ///< Share of the gathers that are made of paths of three edges.
    PairRule pair_rule = PairRule::Gloss;
    bool clamps_disc = true;  ///< Weights know that no probability exceeds 1 [ibid., eq. 24].
    const PairDensity* density =
        nullptr;  ///< Of the partners that a gather has; nullptr: as if it had one.

    friend bool operator==(const TechniqueCounts&, const TechniqueCounts&) = default;
    bool uses_light_paths() const {
        return connect > 0 || connect_emission > 0 || splat > 0 || hit_lens > 0 || merge > 0 ||
               gather > 0;
    }
    /// Samples of each pair of a path of so many edges.
    float gathers(int edges) const {
        return edges < min_pair_edges ? 0.0f : edges == 3 ? gather * short_pair_rate : gather;
    }
    /// The same for the weights, at an x_m of this level: pairs of one vertex are not independent.
    double gathers_at(uint8_t pair_level, int edges) const {
        const double n = double(gathers(edges));
        return density ? n * density->share(pair_level) : n;
    }
    uint8_t pair_level(Vec3 p) const { return density ? density->level(p) : uint8_t(0); }
    /// Approximate probability that a pair is found whose dropped vertex has the area density `pdf` [ibid., eq. 24].
    double found(double pdf) const {
        const double p = double(disc) * pdf;
        return clamps_disc && p > 1 ? 1 : p;
    }
    float of(const Technique& q) const {
        switch (q.strategy) {
        case Strategy::Hit: return hit;
        case Strategy::NextEvent: return next_event;
        case Strategy::Connect: return q.s == 1 ? connect_emission : connect;
        case Strategy::Splat: return splat;
        case Strategy::HitLens: return hit_lens;
        case Strategy::Merge: return merge;
        case Strategy::Gather: return gathers(q.vertices() - 1);
        }
        return 0;
    }
};

}  // namespace etendue
