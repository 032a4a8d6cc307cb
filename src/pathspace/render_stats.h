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
    PhaseSeconds phases;
    int time_factor = 0;  ///< Of the seconds of the current sample; 0: it is not timed.
    /// One sample of 31 is timed, since clocks take long to read. Where samples are made in turns of eight (kWalksInTurn), each
    /// place is timed as often.
    static int time_factor_of(uint64_t index) {
        constexpr int kTimedSamples = 31;
        return index % kTimedSamples == 0 ? kTimedSamples : 0;
    }
    uint64_t eye_paths = 0, light_paths = 0, vertices = 0;
    uint64_t walk_rays = 0, shadow_rays = 0, visible = 0;
    uint64_t joins_skipped = 0;           ///< By Russian roulette before the shadow ray.
    uint64_t pairs = 0;                   ///< Merged, or found by searches for gathers.
    uint64_t visible_pairs = 0;           ///< Gathered pairs whose shadow ray was not blocked.
    uint64_t trials = 0, trial_rays = 0;  ///< Of all visible pairs.
    /// By trials: 1, 2, 3–4, 5–8, …
    using ByTrials = std::array<uint64_t, 24>;
    ByTrials pairs_by_trials{};  ///< Visible pairs. The share of those with 1 is 1 - Var(r)/E(r)².
    ByTrials chains_by_trials{};
    uint64_t chains = 0;           ///< Found by specular connections, and evaluated.
    uint64_t chain_seeds = 0;      ///< From which Newton's method started, or could not start.
    uint64_t chain_trials = 0;     ///< Those of them that were trials.
    uint64_t chain_failures = 0;   ///< Searches in which Newton's method found no chain.
    uint64_t chain_rays = 0;       ///< Of seeds and of Newton's method.
    uint64_t bounds_exceeded = 0;  ///< Densities above their assumed bound; must be 0.
    uint64_t runaways = 0;         ///< Pairs abandoned after too many trials; must be 0.
    uint64_t rejected = 0;         ///< Contributions that were not finite or negative.

    static void count_trials(uint64_t n, ByTrials& of) {
        ++of[std::min<size_t>(size_t(std::bit_width(n - 1)), of.size() - 1)];
    }
    RenderStats& operator+=(const RenderStats& o);
    /// All numbers; a new one does not compile until it is here.
    template <class Stats, class Use>
    static void for_each_field(Stats& stats, const Use& use) {
        auto& [phases, time_factor, eye_paths, light_paths, vertices, walk_rays, shadow_rays,
               visible, joins_skipped, pairs, visible_pairs, trials, trial_rays, pairs_by_trials,
               chains_by_trials, chains, chain_seeds, chain_trials, chain_failures, chain_rays,
               bounds_exceeded, runaways, rejected] = stats;
        (void)time_factor;  // Of the current sample.
        use(phases), use(eye_paths), use(light_paths), use(vertices), use(walk_rays);
        use(shadow_rays), use(visible), use(joins_skipped), use(pairs), use(visible_pairs);
        use(trials), use(chains), use(chain_seeds), use(chain_trials), use(chain_rays);
        use(chain_failures), use(chains_by_trials);
        use(trial_rays), use(pairs_by_trials), use(bounds_exceeded), use(runaways), use(rejected);
    }
    uint64_t rays() const { return walk_rays + shadow_rays + trial_rays + chain_rays; }
};

/// Adds the time until its destruction to a phase, if the sample is timed.
class PhaseTimer {
public:
    PhaseTimer(RenderStats& stats, double PhaseSeconds::*phase)
        : seconds_(stats.phases.*phase), time_factor_(stats.time_factor) {
        if (time_factor_ > 0) begin_ = Clock::now();
    }
    ~PhaseTimer() {
        if (time_factor_ > 0)
            seconds_ += time_factor_ * std::chrono::duration<double>(Clock::now() - begin_).count();
    }
    PhaseTimer(const PhaseTimer&) = delete;
    PhaseTimer& operator=(const PhaseTimer&) = delete;

private:
    using Clock = std::chrono::steady_clock;
    double& seconds_;
    int time_factor_;
    Clock::time_point begin_;
};

}  // namespace etendue
