#pragma once
// One Markov chain [Metropolis et al. 1953; Hastings 1970]. States are added with their expected weights, and large steps
// also serve as independent samples [Kelemen et al. 2002].
//
// The image is the mean over the steps of F times a factor, where F is the contribution of a state. As states of the chain,
// the states of a step have the factors b·a/I, with a the probability of being in this state after the step. As independent
// samples, large steps have density p_L; all densities are relative to that of independent states. The balance heuristic
// combines the two estimators, with a constant c in place of b:
//     w = I / (I + c p_L),      chain: b·a·w/I,      large step: (1 - w)/p_L.
// The estimate is unbiased for any c that is fixed before the chain starts. A c from the chain's own run would be
// correlated with its states.

#include "mcmc/state.h"

namespace etendue {

/// Counts of the steps of one kind on states of one length.
struct StepCounts {
    uint64_t proposed = 0, failed = 0, zero = 0;  ///< zero: proposals with I(y) = 0
    double accepted = 0;                          ///< Sum of acceptance probabilities.

    StepCounts& operator+=(const StepCounts& o) {
        proposed += o.proposed, failed += o.failed, zero += o.zero;
        accepted += o.accepted;
        return *this;
    }
};

/// Statistics of the steps of one chain, or of several.
struct ChainStats {
    static constexpr int kLengths = 16;    ///< Longer paths are counted with the last length.
    static constexpr int kMutations = 11;  ///< 0: large steps, then StateSpace::mutations().

    /// By mutation, and by the path length of x (for large steps, of y).
    std::array<std::array<StepCounts, kLengths>, kMutations> steps{};
    uint64_t longest_stay = 0;  ///< Largest number of successive steps without an accepted one.
    uint64_t large_steps = 0;
    uint64_t later_samples = 0;               ///< See chain_groups.h.
    double large_sum = 0;                     ///< Sum of I over large steps.
    double chain_light = 0, large_light = 0;  ///< Σ I·factor, of the two parts of the estimator.

    ChainStats& operator+=(const ChainStats& o);
};

/// Constants of all chains of a class.
struct ChainTerms {
    double p_large = 0.3;
    double c = 0;
};

class Chain {
public:
    /// A chain that has not started. It makes only large steps, as does a chain whose pool contributes nothing.
    Chain(const StateSpace& space, int chain_class);

    void start_black() { is_started_ = false; }
    void start(const Find& find, const ChainContext& c);
    void copy(const Chain& from);

    /// Makes `count` steps, whose random numbers are functions of `key` and the number of the step. Adds the states with the
    /// factors given above, times `scale`. Adds what large steps have found to `finds`, if it is given.
    void advance(const ChainTerms& terms, double b, double scale, uint64_t key, uint64_t count,
                 const ChainContext& c, StateSink& states, ChainStats& stats,
                 std::vector<Find>* finds = nullptr);

    void save(LearnedState& to) const;
    void load(LearnedState& from);

private:
    /// Sets y_ to the next state, if it is accepted.
    Proposal propose(bool is_large, uint64_t key, const ChainContext& c);
    double acceptance(const Proposal& proposal, RenderStats& stats) const;

    const StateSpace& space_;
    int class_;
    std::unique_ptr<ChainState> x_, y_;
    bool is_started_ = false;
    uint64_t stay_ = 0;
};

}  // namespace etendue
