#include "reuse/next_event_count.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "reuse/gather_constants.h"

namespace etendue {
namespace {

constexpr std::array<uint32_t, kNextEventCounts> kCandidates{1, 2, 4, 8};
static_assert(kCandidates.back() == kMostNextEvents);

/// The part of the variance that belongs to the paths of these next events, with `count` of them instead.
double moment(std::span<const NextEventDraw> draws, double scale, uint32_t count) {
    const double n = double(draws.size()), factor = count / n;
    double sum = 0, squares = 0, others = 0;
    for (const NextEventDraw& d : draws) {
        const double odds = double(d.weight) / (1 - double(d.weight)),
                     w = weight_of_odds(odds, factor), value = double(d.contribution) * scale,
                     x = w * value * double(d.passed);
        sum += x;
        squares += sqr(x);
        // f/(n_S p_S) = f/(n p) √odds
        if (w < 1) others += sqr((1 - w) * value / n) * double(d.passed) * std::sqrt(odds);
    }
    return std::max(0.0, (squares - sqr(sum) / n) / (n - 1)) / std::pow(count, 1.5) + others;
}

}  // namespace

void NextEventCount::learn(const VarianceAndTime& observed, const GatherTotals& totals) {
    const GatherTotals before = std::exchange(before_, totals);
    const double draws = totals.next_events - before.next_events;
    // One next event tells nothing about the variance of two. If one was best, it remains so.
    if (value_ == 1 || !(draws > 0 && observed.variance > 0)) return;
    std::array<double, kNextEventCounts> moments;
    for (size_t i = 0; i < kNextEventCounts; ++i)
        moments[i] = totals.next_event_moments[i] - before.next_event_moments[i];
    const double time_of_one = kGatherConstants.next_event_time * draws / value_;
    value_ = best_next_event_count(observed, value_, moments, time_of_one);
}

uint32_t best_next_event_count(const VarianceAndTime& observed, uint32_t present,
                               const std::array<double, kNextEventCounts>& moments,
                               double time_of_one) {
    const auto index =
        size_t(std::find(kCandidates.begin(), kCandidates.end(), present) - kCandidates.begin());
    const VarianceAndTime others = observed.without(moments[index], time_of_one * present);
    const auto product = [&](size_t i) {
        return (others.variance + moments[i]) * (others.time + time_of_one * kCandidates[i]);
    };
    // The estimates of the first passes are too noisy for more than one step.
    size_t best = index;
    for (const size_t i : {index - 1, index + 1})
        if (i < kNextEventCounts && product(i) < product(best)) best = i;
    return kCandidates[best];
}

void NextEventCount::observe(std::span<const NextEventDraw> draws, double scale, GatherSums& sums) {
    // Next events that add ten times the pixel's luminance. V leaves rare ones out, too.
    constexpr double kMost = 100;
    sums.next_events += draws.size();
    if (draws.size() < 2) return;
    for (size_t i = 0; i < kNextEventCounts; ++i)
        sums.next_event_moments[i] +=
            GatherMoment::fixed(std::min(moment(draws, scale, kCandidates[i]), kMost));
}

}  // namespace etendue
