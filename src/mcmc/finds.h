#pragma once
// Finds: independent states from which chains may start, kept as the keys that draw them again.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace etendue {

/// A state that an independent sample or a large step has found.
struct Find {
    static constexpr int32_t kLargeStep = -1;

    uint64_t key = 0;
    int32_t part = 0;  ///< Of the sample, which may consist of several states; or kLargeStep.
    int32_t chain_class = 0;
    /// The expectation of the sum of weight·h(x), over all states x of a sample, is ∫ I h.
    double weight = 0;
};

/// Draws `count` indices of weighted items by systematic resampling: item i occurs count·w_i/Σw times on average.
std::vector<size_t> resample(std::span<const double> weights, size_t count, double u);
/// The same of finds.
std::vector<size_t> resample(std::span<const Find> finds, size_t count, double u);
/// Leaves at most `count` of them. Each has the same expected weight as before, and the sum of weights is the same.
void thin(std::vector<Find>& finds, size_t count, double u);

}  // namespace etendue
