#include "reuse/gather_roulette.h"

#include <algorithm>
#include <cmath>

namespace etendue {
namespace {

/// Whole numbers, since their sum does not depend on the order.
constexpr double kUnit = 0x1p24;

}  // namespace

void GatherRoulette::learn(const RenderStats& so_far) {
    // As if there had been a few joins that brought what is first assumed.
    constexpr double kFirst = 0.125, kJoins = 16;
    // By trial on four scenes; a factor of two in either is hardly seen.
    constexpr float kLook = 2, kSearch = 0.7f;
    searches_.fill(0);
    for (size_t i = 0; i < values_.size(); ++i) {
        const RenderStats::PairJoins& joins = so_far.pair_joins[i];
        const float worth = float(std::sqrt((double(joins.squares) / kUnit + kJoins * sqr(kFirst)) /
                                            (double(joins.count) + kJoins)));
        values_[i] = kLook * worth;
        float& search = searches_[i % size_t(kLengths)];
        search = std::max(search, kSearch * worth);
    }
}

void GatherRoulette::observe(int s, int t, float brought, RenderStats& stats) {
    // A few joins that bring much more than was expected are no rule.
    constexpr float kMost = 8;
    RenderStats::PairJoins& joins = stats.pair_joins[index(s, t)];
    ++joins.count;
    if (brought > 0) joins.squares += uint64_t(kUnit * sqr(double(std::min(brought, kMost))));
}

}  // namespace etendue
