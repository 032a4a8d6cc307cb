#pragma once
// One Markov chain [Metropolis et al. 1953; Hastings 1970], with expected values of acceptance, and with large steps that
// count as independent samples too [Kelemen et al. 2002].
//
// The image is Σ over states of F times a factor. Steps of the chain alone would count b·a/I. Independent samples of F are
// there too, p_L T of them a step, so the two are weighed by the balance heuristic with a constant c in place of b:
//     w = I / (I + c p_L T),      chain: b·a·w/I,      large step: (1 - w)/(p_L T).
// Any c will do that is fixed before the chain begins; that of the chain's own run would be correlated with its states.

#include "mcmc/state.h"

namespace etendue {

/// Of the steps of one kind on states of one length.
struct StepCounts {
    uint64_t proposed = 0, failed = 0, zero = 0;  ///< zero: I(y) = 0
    double accepted = 0;                          ///< Sum of acceptance probabilities.

    StepCounts& operator+=(const StepCounts& o) {
        proposed += o.proposed, failed += o.failed, zero += o.zero;
        accepted += o.accepted;
        return *this;
    }
};

/// What the steps of a chain, or of many, did.
struct ChainStats {
    static constexpr int kLengths = 16;   ///< Longer paths count with the last.
    static constexpr int kMutations = 8;  ///< 0: large steps, then StateSpace::mutations().

    /// By mutation, and by the length of x (of large steps, y).
    std::array<std::array<StepCounts, kLengths>, kMutations> steps{};
    uint64_t longest_stay = 0;  ///< Steps without an accepted one.
    uint64_t large_steps = 0;
    double large_sum = 0;                     ///< Of I/T over large steps.
    double chain_light = 0, large_light = 0;  ///< Σ I·factor, of the two parts of the estimator.

    ChainStats& operator+=(const ChainStats& o);
};

/// Of all chains of a class, constant.
struct ChainTerms {
    double p_large = 0.3;
    double c = 0;
};

class Chain {
public:
    /// Not started: makes large steps only, as it does where the pool it would start from is black.
    Chain(const StateSpace& space, int chain_class);

    void start_black() { is_started_ = false; }
    /// At the state that `key` draws.
    void start(uint64_t key, const ChainContext& c);
    void copy(const Chain& from);

    /// Makes steps first … first+count-1; random numbers follow from `key` and the step's number. Adds b·…/steps and so
    /// on as above, times `scale`.
    void advance(const ChainTerms& terms, double b, double scale, uint64_t key, uint64_t first,
                 uint64_t count, const ChainContext& c, StateSink& states, ChainStats& stats);

    void save(LearnedState& to) const;
    void load(LearnedState& from);

private:
    void add(const ChainState& state, double chain_share, double large_share,
             const ChainTerms& terms, double scale, StateSink& states, ChainStats& stats) const;

    const StateSpace& space_;
    int class_;
    std::unique_ptr<ChainState> x_, y_;
    bool is_started_ = false;
    uint64_t stay_ = 0;
};

}  // namespace etendue
