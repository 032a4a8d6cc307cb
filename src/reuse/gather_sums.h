#pragma once
// Statistics of the gathers of a pass, from which later passes learn.

#include <array>
#include <memory>
#include <span>

#include "pathspace/sample_context.h"

namespace etendue {

/// Number of candidates for the scale c of GatherWeightScale.
inline constexpr size_t kWeightScales = 6;
/// GatherRoulette does not distinguish sub-paths of more vertices than this.
inline constexpr size_t kGatherLengths = 8;

/// Sums of one worker in a pass, in fixed point.
struct GatherSums final : PassSums {
    /// GatherMoment::fixed() by candidates of GatherWeightScale.
    std::array<uint64_t, kWeightScales> weight_moments{};
    /// The same with the number of gathers, and with GatherRadius::kMore times that number.
    uint64_t moment = 0, moment_of_more = 0;
    struct Joins {
        uint64_t count = 0, squares = 0;
    };
    std::array<Joins, kGatherLengths * kGatherLengths> joins{};
    /// Pairs that would have been found if roulette had ended no search, in units of 1/256.
    uint64_t expected_pairs = 0;

    static GatherSums& of(Workspace& work) { return static_cast<GatherSums&>(*work.sums); }

    void add(const GatherSums& o) {
        for (size_t i = 0; i < kWeightScales; ++i) weight_moments[i] += o.weight_moments[i];
        moment += o.moment;
        moment_of_more += o.moment_of_more;
        for (size_t i = 0; i < joins.size(); ++i) {
            joins[i].count += o.joins[i].count;
            joins[i].squares += o.joins[i].squares;
        }
        expected_pairs += o.expected_pairs;
    }
};

/// Sums over all finished passes.
struct GatherTotals {
    std::array<double, kWeightScales> weight_moments{};
    double moment = 0, moment_of_more = 0;
    struct Joins {
        double count = 0, squares = 0;
    };
    std::array<Joins, kGatherLengths * kGatherLengths> joins{};
    double expected_pairs = 0;

    /// Adds a pass. Sums of its workers are added as integers first, so that the order of workers does not matter.
    void add(std::span<const std::unique_ptr<PassSums>> workers) {
        GatherSums pass;
        for (const auto& w : workers) pass.add(static_cast<const GatherSums&>(*w));
        for (size_t i = 0; i < kWeightScales; ++i)
            weight_moments[i] += double(pass.weight_moments[i]);
        moment += double(pass.moment);
        moment_of_more += double(pass.moment_of_more);
        for (size_t i = 0; i < joins.size(); ++i) {
            joins[i].count += double(pass.joins[i].count);
            joins[i].squares += double(pass.joins[i].squares);
        }
        expected_pairs += double(pass.expected_pairs) / 256;
    }
};

}  // namespace etendue
