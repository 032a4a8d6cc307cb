#pragma once
// Systematic sampling: a random choice of items, each with its own probability.

namespace etendue {

/// Selects each item of a sequence with its own probability. The number of selected items is the sum of all
/// probabilities, rounded up or down, so that it varies less than if each item were selected independently.
class SystematicSampling {
public:
    /// `u`: uniformly distributed in [0, 1).
    explicit SystematicSampling(double u) : sum_(u) {}

    /// Whether the next item, of probability `p` in [0, 1], is selected.
    bool selects(double p) {
        sum_ += p;
        if (sum_ < 1) return false;
        sum_ -= 1;
        return true;
    }

private:
    double sum_;
};

}  // namespace etendue
