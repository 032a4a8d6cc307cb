#pragma once
// The number of next events at an eye vertex fixed by the film point, learned from earlier passes.

#include <array>
#include <span>

#include "reuse/gather_radius.h"
#include "reuse/gather_sums.h"

namespace etendue {

/// One next event of an eye vertex.
struct NextEventDraw {
    float contribution = 0;  ///< Luminance for weight 1; 0 where there is none.
    float weight = 0;        ///< MIS weight.
    /// Transmittance, divided by the probability of surviving Russian roulette; 0 where either has ended it.
    float passed = 0;
};

/// The next events of an eye vertex.
struct NextEventDraws {
    std::array<NextEventDraw, kMostNextEvents> draws{};
    uint32_t count = 0;

    std::span<const NextEventDraw> span() const { return {draws.data(), count}; }
};

/// A vertex fixed by the film point (Vertex) is not a random choice, and its sample is costly where it also gathers.
/// Several next events there share that cost. Their number N is that of the least product of variance and time. With N'
/// instead, variance and time of a sample are taken to be
///     V - M(N) + M(N')   and   T - t N + t N'.
/// M(N) is the part of the variance that belongs to paths that these next events can make,
///     Var(w C) / N^1.5 + ∫ (1 - w)² f² / (n_S p_S),
/// where C is the contribution of a next event, w its weight, which grows with N, and S stands for all other techniques.
/// The exponent is that of stratified points on a light that has a shadow's edge [Mitchell 1996]. Var(w C) is estimated
/// from the differences between the next events of one vertex, of which there are at least two until something is known.
/// All of this is estimated from earlier passes, so that the image remains unbiased.
class NextEventCount {
public:
    /// Chooses N for the next passes. `observed`: of the passes since the last call.
    void learn(const VarianceAndTime& observed, const GatherTotals& totals);
    /// N.
    uint32_t value() const { return value_; }

    /// Records the next events of a vertex fixed by the film point. `scale`: factor from a contribution to that of the
    /// pixel, relative to the pixel's luminance.
    static void observe(std::span<const NextEventDraw> draws, double scale, GatherSums& sums);

    template <class Count, class Use>
    static void for_each_field(Count& count, const Use& use) {
        auto& [value, before] = count;
        use(value), use(before);
    }

private:
    uint32_t value_ = 2;
    GatherTotals before_;
};

/// The candidate for N with the least product, among `present`, the next smaller and the next larger one. `moments`: sums
/// of M of the candidates; `present`: N of the observed passes; `time_of_one`: time of their next events, divided by N.
uint32_t best_next_event_count(const VarianceAndTime& observed, uint32_t present,
                               const std::array<double, kNextEventCounts>& moments,
                               double time_of_one);

}  // namespace etendue
