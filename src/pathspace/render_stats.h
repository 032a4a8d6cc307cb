#pragma once
// Statistics of a rendering, counted by each worker and merged at the end of a pass.

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>

namespace etendue {

/// Time spent on samples by phase, in seconds of one thread.
struct PhaseSeconds {
    double light_paths = 0;  ///< Including their techniques with t ≤ 1.
    double eye_paths = 0;    ///< Including all their joins.
    double connections = 0;  ///< To light vertices, including the choice of these.
    double records = 0;      ///< Importance records.

    PhaseSeconds& operator+=(const PhaseSeconds& o) {
        light_paths += o.light_paths, eye_paths += o.eye_paths;
        connections += o.connections, records += o.records;
        return *this;
    }
};

/// Counters of one worker; merged at the end of a pass.
struct RenderStats {
    /// Every kTimedSamples-th sample is timed.
    static constexpr int kTimedSamples = 8;
    PhaseSeconds phases;
    int stands_for =
        0;  ///< Number of samples for whose time that of the current one stands; 0: it is not timed.
    /// The number for sample `index`.
    static int samples_timed_by(uint64_t index) {
        return index % kTimedSamples == 0 ? kTimedSamples : 0;
    }
    uint64_t eye_paths = 0, light_paths = 0, vertices = 0;
    uint64_t walk_rays = 0, shadow_rays = 0, visible = 0;
    uint64_t joins_skipped = 0;           ///< By Russian roulette before the shadow ray.
    uint64_t pairs = 0;                   ///< Merged, or found by searches for gathers.
    uint64_t visible_pairs = 0;           ///< Gathered pairs whose shadow ray was not blocked.
    uint64_t trials = 0, trial_rays = 0;  ///< Of all visible pairs.
    /// Visible pairs by trials: 1, 2, 3–4, 5–8, … The share of those with 1 is 1 - Var(r)/E(r)².
    std::array<uint64_t, 24> pairs_by_trials{};
    uint64_t bounds_exceeded = 0;  ///< Densities above their assumed bound; must be 0.
    uint64_t runaways = 0;         ///< Pairs abandoned after too many trials; must be 0.
    uint64_t rejected = 0;         ///< Contributions that were not finite or negative.

    void count_trials(uint64_t n) {
        ++pairs_by_trials[std::min<size_t>(size_t(std::bit_width(n - 1)),
                                           pairs_by_trials.size() - 1)];
    }
    RenderStats& operator+=(const RenderStats& o);
    uint64_t rays() const { return walk_rays + shadow_rays + trial_rays; }
};

/// Adds the time until its destruction to a phase, if the sample is timed.
class PhaseTimer {
public:
    PhaseTimer(RenderStats& stats, double PhaseSeconds::*phase)
        : seconds_(stats.phases.*phase), stands_for_(stats.stands_for) {
        if (stands_for_ > 0) begin_ = Clock::now();
    }
    ~PhaseTimer() {
        if (stands_for_ > 0)
            seconds_ += stands_for_ * std::chrono::duration<double>(Clock::now() - begin_).count();
    }
    PhaseTimer(const PhaseTimer&) = delete;
    PhaseTimer& operator=(const PhaseTimer&) = delete;

private:
    using Clock = std::chrono::steady_clock;
    double& seconds_;
    int stands_for_;
    Clock::time_point begin_;
};

}  // namespace etendue
