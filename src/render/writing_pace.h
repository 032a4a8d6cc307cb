#pragma once

#include <algorithm>
#include <limits>

namespace etendue {

/// How often a file is written beside the passes: every so many seconds, or less often if it would take a larger share of the
/// time.
struct WritingPace {
    static constexpr double kMostOfTime = 0.01;
    /// One checkpoint that took long, such as one that waited for a disk, postpones the next one by no more than a quarter of
    /// an hour.
    static WritingPace of_checkpoints(double interval, double most = kMostOfTime) {
        return {interval, most, 900};
    }

    double interval, most = kMostOfTime, longest_wait = std::numeric_limits<double>::infinity();

    /// Seconds from the end of a file that took `taken` seconds to the next one.
    double wait_after(double taken) const {
        return std::max(interval, std::min(taken / most, longest_wait));
    }
};

}  // namespace etendue
