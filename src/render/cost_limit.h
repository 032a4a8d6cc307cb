#pragma once
// Renderings that end where they would cost too much.

#include <atomic>
#include <functional>
#include <optional>
#include <utility>

#include "pathspace/sample_context.h"

namespace etendue {

/// Ends a rendering in the pass, or in the preparation of the first one, that would make it cost more than `most`. Whether it
/// ends does not depend on the number of threads: it does if the whole pass would cost more.
struct CostLimit {
    std::function<double(const RenderStats&)> cost;
    double most;
    /// Passes count so many times, and Integrator::prepare() once: of several such renderings, which must not cost more
    /// together, only the first one prepares anything.
    double renderings = 1;

    double cost_of(const RenderStats& preparation, const RenderStats& passes) const {
        return cost(preparation) + renderings * cost(passes);
    }
};

/// What a rendering costs while the threads of a pass work.
class RunningCost {
public:
    /// `before`: what the rendering has cost before the pass.
    RunningCost(const std::optional<CostLimit>& limit, double before)
        : limit_(limit), sum_(before), factor_(limit ? limit->renderings : 1) {}

    /// What follows is no part of a pass, see CostLimit::renderings.
    void count_once() { factor_ = 1; }

    /// Adds what a worker has done, and ends the pass where the sum is too high.
    class Meter {
    public:
        Meter(RunningCost& sum, const Workspace& work)
            : sum_(sum), work_(work), before_(sum.of(work)) {}
        void update() {
            const double now = sum_.of(work_);
            sum_.add(now - std::exchange(before_, now));
        }

    private:
        RunningCost& sum_;
        const Workspace& work_;
        double before_;
    };

private:
    double of(const Workspace& work) const { return limit_ ? limit_->cost(work.stats) : 0; }
    void add(double cost) {
        if (!limit_) return;
        // The sum has rounding errors that depend on the order. Where it is too high, the exact one is, too.
        constexpr double kRounding = 1e-6;
        const double more = factor_ * cost;
        if (sum_.fetch_add(more) + more > (1 + kRounding) * limit_->most) throw PassDropped();
    }

    const std::optional<CostLimit>& limit_;
    std::atomic<double> sum_;
    double factor_;
};

}  // namespace etendue
