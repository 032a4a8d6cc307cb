// The number of next events at a vertex fixed by the film point.

#include "reuse/next_event_count.h"

#include <cmath>

#include <gtest/gtest.h>

namespace etendue {
namespace {

using CountMoments = std::array<double, kNextEventCounts>;

/// Moments of the candidates, from the next events of one vertex.
CountMoments moments_of(std::vector<NextEventDraw> draws, double scale = 1) {
    GatherSums sums;
    NextEventCount::observe(draws, scale, sums);
    EXPECT_EQ(sums.next_events, draws.size());
    CountMoments moments;
    for (size_t i = 0; i < kNextEventCounts; ++i)
        moments[i] = double(sums.next_event_moments[i]) / GatherMoment::kUnit;
    return moments;
}
void expect_near(const CountMoments& a, const CountMoments& b) {
    for (size_t i = 0; i < kNextEventCounts; ++i) EXPECT_NEAR(a[i], b[i], 2e-6) << i;
}

/// No other technique makes the path, and one of two points is hidden: the variance of one is 2, that of N is less by
/// N^1.5.
TEST(NextEventCount, KnowsTheVarianceOfOneFromTheDifferences) {
    const NextEventDraw seen{.contribution = 2, .weight = 1, .passed = 1},
        hidden{.contribution = 2, .weight = 1, .passed = 0};
    expect_near(moments_of({seen, hidden}),
                {2, 2 / std::pow(2, 1.5), 2 / std::pow(4, 1.5), 2 / std::pow(8, 1.5)});
    expect_near(moments_of({seen, hidden}, 3),
                {18, 18 / std::pow(2, 1.5), 18 / 8.0, 18 / std::pow(8, 1.5)});
    expect_near(moments_of({seen, seen}), {});
    expect_near(moments_of({hidden, hidden}), {});
    // One alone tells nothing.
    expect_near(moments_of({seen}), {});
}

/// Of two next events with the weight 1/2, odds are (N/2)² with N instead, and (n_S p_S)/p is 2.
TEST(NextEventCount, KnowsThatOthersGiveTheirWeight) {
    const NextEventDraw d{.contribution = 1, .weight = 0.5f, .passed = 1};
    CountMoments expected;
    for (size_t i = 0; i < kNextEventCounts; ++i) {
        const double n = std::pow(2.0, double(i)), w = n * n / (n * n + 4);
        expected[i] = (1 - w) * (1 - w) / 2;
    }
    expect_near(moments_of({d, d}), expected);
    // Roulette leaves half of them with twice the value.
    const NextEventDraw twice{.contribution = 1, .weight = 0.5f, .passed = 2},
        none{.contribution = 1, .weight = 0.5f, .passed = 0};
    const CountMoments with_roulette = moments_of({twice, none});
    for (size_t i = 0; i < kNextEventCounts; ++i) {
        const double n = std::pow(2.0, double(i)), w = n * n / (n * n + 4);
        EXPECT_NEAR(with_roulette[i], expected[i] + 2 * w * w / std::pow(n, 1.5), 2e-6) << i;
    }
}

TEST(NextEventCount, HasTheLeastProductOfVarianceAndTime) {
    for (const double b : {0.01, 0.2, 0.8})
        for (const double time : {0.01, 0.1, 0.4}) {
            const auto product = [&](uint32_t n) {
                return (1 - b + b / n) * (1 - time + time * n);
            };
            for (const uint32_t present : {2u, 4u, 8u}) {
                CountMoments moments;
                for (size_t i = 0; i < kNextEventCounts; ++i) moments[i] = b / double(1u << i);
                const VarianceAndTime observed{1 - b + b / present, 1 - time + time * present};
                const uint32_t chosen = best_next_event_count(observed, present, moments, time);
                for (const uint32_t other : {present / 2, present, std::min(2 * present, 8u)})
                    EXPECT_LE(product(chosen), product(other) * (1 + 1e-9))
                        << "b " << b << ", time " << time << ", present " << present;
            }
        }
}

TEST(NextEventCount, IsOneWhereMoreGainNothing) {
    NextEventCount count;
    EXPECT_EQ(count.value(), 2);
    GatherTotals totals;
    count.learn({1, 1}, totals);
    EXPECT_EQ(count.value(), 2) << "nothing was observed";
    totals.next_events = 100;
    count.learn({100, 1000}, totals);
    EXPECT_EQ(count.value(), 1);
}

}  // namespace
}  // namespace etendue
