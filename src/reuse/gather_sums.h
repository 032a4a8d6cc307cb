#pragma once
// Statistics of the gathers of a pass, from which later passes learn.

#include <array>
#include <memory>
#include <span>

#include "pathspace/learned_state.h"
#include "pathspace/sample_context.h"
#include "reuse/gather_moment.h"

namespace etendue {

/// Number of candidates for the scale c of GatherWeightScale.
inline constexpr size_t kWeightScales = 6;
/// Number of candidates for the change of a radius, see GatherRadius.
inline constexpr size_t kRadiusChanges = 5;
/// Number of candidates for NextEventCount, and the largest.
inline constexpr size_t kNextEventCounts = 4, kMostNextEvents = 8;
/// GatherRoulette does not distinguish sub-paths of more vertices than this.
inline constexpr size_t kGatherLengths = 8;

/// Sums of one worker in a pass, in fixed point.
struct GatherSums final : PassSums {
    /// GatherMoment::fixed() by candidates of GatherWeightScale.
    std::array<uint64_t, kWeightScales> weight_moments{};
    /// Of gathers at eye vertices fixed by the film point (Vertex): GatherMoment::fixed(), and trials in units of 1/256, by
    /// the factor of the number of pairs.
    std::array<uint64_t, kRadiusChanges> moments{}, trials{};
    uint64_t candidates = 0, inner_candidates = 0;  ///< Light vertices that searches looked at.
    /// Pairs that would have been found if roulette had ended no search, in units of 1/256; by Vertex::is_fixed_by_film.
    std::array<uint64_t, 2> expected_pairs{};
    /// Of next events at eye vertices fixed by the film point: GatherMoment::fixed() by candidates of NextEventCount.
    std::array<uint64_t, kNextEventCounts> next_event_moments{};
    uint64_t next_events = 0;
    struct Joins {
        uint64_t count = 0, squares = 0;
    };
    std::array<Joins, kGatherLengths * kGatherLengths> joins{};

    static GatherSums& of(Workspace& work) { return static_cast<GatherSums&>(*work.sums); }

    void save(LearnedState& to) const override {
        for_each(*this, [&](const auto& sums) { to.put(sums); });
    }
    void load(LearnedState& from) override {
        for_each(*this, [&](auto& sums) { from.get(sums); });
    }

    void add(const GatherSums& o) {
        for (size_t i = 0; i < kWeightScales; ++i) weight_moments[i] += o.weight_moments[i];
        for (size_t i = 0; i < kRadiusChanges; ++i) {
            moments[i] += o.moments[i];
            trials[i] += o.trials[i];
        }
        candidates += o.candidates;
        inner_candidates += o.inner_candidates;
        for (size_t i = 0; i < 2; ++i) expected_pairs[i] += o.expected_pairs[i];
        for (size_t i = 0; i < kNextEventCounts; ++i)
            next_event_moments[i] += o.next_event_moments[i];
        next_events += o.next_events;
        for (size_t i = 0; i < joins.size(); ++i) {
            joins[i].count += o.joins[i].count;
            joins[i].squares += o.joins[i].squares;
        }
    }

private:
    template <class Sums, class Use>
    static void for_each(Sums& s, const Use& use) {
        use(s.weight_moments), use(s.moments), use(s.trials);
        use(s.candidates), use(s.inner_candidates), use(s.expected_pairs);
        use(s.next_event_moments), use(s.next_events), use(s.joins);
    }
};

/// Sums over all finished passes.
struct GatherTotals {
    std::array<double, kWeightScales> weight_moments{};
    std::array<double, kRadiusChanges> moments{}, trials{};
    double candidates = 0, inner_candidates = 0;
    std::array<double, 2> expected_pairs{};
    std::array<double, kNextEventCounts> next_event_moments{};
    double next_events = 0;
    struct Joins {
        double count = 0, squares = 0;
    };
    std::array<Joins, kGatherLengths * kGatherLengths> joins{};

    /// Adds a pass. Sums of its workers are added as integers first, so that the order of workers does not matter.
    void add(std::span<const std::unique_ptr<PassSums>> workers) {
        GatherSums pass;
        for (const auto& w : workers) pass.add(static_cast<const GatherSums&>(*w));
        for (size_t i = 0; i < kWeightScales; ++i)
            weight_moments[i] += double(pass.weight_moments[i]);
        for (size_t i = 0; i < kRadiusChanges; ++i) {
            moments[i] += double(pass.moments[i]) / GatherMoment::kUnit;
            trials[i] += double(pass.trials[i]) / 256;
        }
        candidates += double(pass.candidates);
        inner_candidates += double(pass.inner_candidates);
        for (size_t i = 0; i < 2; ++i) expected_pairs[i] += double(pass.expected_pairs[i]) / 256;
        for (size_t i = 0; i < kNextEventCounts; ++i)
            next_event_moments[i] += double(pass.next_event_moments[i]) / GatherMoment::kUnit;
        next_events += double(pass.next_events);
        for (size_t i = 0; i < joins.size(); ++i) {
            joins[i].count += double(pass.joins[i].count);
            joins[i].squares += double(pass.joins[i].squares);
        }
    }
};

}  // namespace etendue
