#pragma once
// The walk: the one way in which sub-paths are made, from either end.

#include <chrono>

#include "pathspace/mis.h"
#include "pathspace/vertex.h"
#include "sampler/sampler.h"

namespace etendue {

/// Where the time of samples goes, seconds on one thread. Only every kTimedSamples-th sample is timed.
struct PhaseSeconds {
    double light_paths = 0;  ///< With their techniques t ≤ 1.
    double eye_paths = 0;    ///< With all that follows.
    double connections = 0;  ///< To light vertices, their choice included.
    double records = 0;      ///< Importance records.

    PhaseSeconds& operator+=(const PhaseSeconds& o) {
        light_paths += o.light_paths, eye_paths += o.eye_paths;
        connections += o.connections, records += o.records;
        return *this;
    }
};

/// Counters of one worker; merged at the end of a pass.
struct RenderStats {
    static constexpr int kTimedSamples = 8;
    PhaseSeconds phases;
    bool is_timed = false;  ///< The sample at hand.
    uint64_t eye_paths = 0, light_paths = 0, vertices = 0;
    uint64_t walk_rays = 0, shadow_rays = 0, visible = 0;
    uint64_t joins_skipped = 0;  ///< By roulette, before their shadow ray.
    uint64_t pairs = 0;          ///< Merged by vcm, or found by gathers, before any roulette.
    uint64_t visible_pairs = 0;  ///< Gathered, and joined without obstacle.
    uint64_t trials = 0, trial_rays = 0;  ///< Of all visible pairs.
    /// Visible pairs by trials: 1, 2, 3–4, 5–8, … The share of those with 1 is 1 - Var(r)/E(r)².
    std::array<uint64_t, 24> pairs_by_trials{};
    std::array<uint64_t, 6> second_moments{};  ///< See PairCount.
    struct PairJoins {
        uint64_t count = 0, squares = 0;
    };
    static constexpr int kPairLengths = 8;
    std::array<PairJoins, kPairLengths * kPairLengths> pair_joins{};  ///< See PairWorth.
    uint64_t bounds_exceeded = 0;  ///< Densities above their bound: must stay 0.
    uint64_t runaways = 0;         ///< Pairs given up after too many trials: must stay 0.
    uint64_t rejected = 0;         ///< Contributions that were not finite or negative.

    void count_trials(uint64_t n) {
        ++pairs_by_trials[std::min<size_t>(size_t(std::bit_width(n - 1)),
                                           pairs_by_trials.size() - 1)];
    }
    RenderStats& operator+=(const RenderStats& o);
    uint64_t rays() const { return walk_rays + shadow_rays + trial_rays; }
};

/// Adds the time until its end to a phase, where the sample is timed.
class PhaseTimer {
public:
    PhaseTimer(RenderStats& stats, double PhaseSeconds::*phase)
        : seconds_(stats.is_timed ? &(stats.phases.*phase) : nullptr) {
        if (seconds_) begin_ = Clock::now();
    }
    ~PhaseTimer() {
        if (seconds_)
            *seconds_ += RenderStats::kTimedSamples *
                         std::chrono::duration<double>(Clock::now() - begin_).count();
    }
    PhaseTimer(const PhaseTimer&) = delete;
    PhaseTimer& operator=(const PhaseTimer&) = delete;

private:
    using Clock = std::chrono::steady_clock;
    double* seconds_;
    Clock::time_point begin_;
};

/// How far a walk goes.
struct WalkOptions {
    int max_vertices = 1 << 20;  ///< Of the sub-path, its first vertex included.
    int rr_depth = 5;            ///< Russian roulette from the vertex with this index on.
};

/// z_0 on the lens and, if the scene is met, z_1. The film point is drawn from the pixel's filter.
/// Where the ray leaves the scene, z_1 is a vertex at infinity if there are emitters there, else z_0 stays alone.
void start_eye_path(const Scene& scene, const Film& film, uint64_t pixel, Sampler& sampler,
                    const TechniqueCounts& counts, SubPath& z, RenderStats& stats);
/// y_0 on an emitter and, if the scene is met, y_1. False where there is no emitter to choose.
bool start_light_path(const Scene& scene, Sampler& sampler, const TechniqueCounts& counts,
                      SubPath& y, RenderStats& stats);

/// p_NE / p_L of y_0 for a next vertex along `w`.
float next_event_ratio(const Vertex& y0, Vec3 w);

/// Samples scattering at the last vertex and appends the next one. False where the walk ends: absorbed, roulette, or
/// out of the scene; in the last case an eye walk over a scene with emitters at infinity has appended a vertex there.
template <TransportMode mode>
bool extend(const Scene& scene, Sampler& sampler, const WalkOptions& options,
            const TechniqueCounts& counts, SubPath& path, RenderStats& stats);

/// Appends the surface that an eye path meets from its last vertex along `wi`, which has not been sampled: with throughput
/// `beta`, fit for its radiance, but not for weights. False where it leaves the scene.
bool look_along(const Scene& scene, Sampler& sampler, Vec3 wi, Rgb beta, SubPath& z,
                RenderStats& stats);

}  // namespace etendue
