#pragma once
// Chains in primary sample space [Kelemen et al. 2002]: a state consists of the random numbers that a sample reads, and all
// contributions of the sample.

#include <functional>

#include "mcmc/numbers.h"
#include "mcmc/state.h"
#include "mcmc/target_map.h"

namespace etendue {

/// A sample as a function of its random numbers (context.sampler) and its class; adds its joins to context.sink.
using PrimarySample = std::function<void(int chain_class, const SampleContext&, Workspace&)>;

/// Collects the joins of one sample of the whole film.
class SplatCollector final : public ContributionSink {
public:
    /// Replaces the contents of `state`. If `map` is nullptr, the target is the luminance.
    SplatCollector(const Film& film, const TargetMap* map, ChainState& state, Workspace& work);
    void add(const Join& join, Rgb contribution) override;
    /// Is also called with the luminance of every join, before the factor W.
    std::function<void(const Join&, double luminance)> observer;

private:
    FilmRegion region_;
    const TargetMap* map_;
    ChainState& state_;
    Workspace& work_;
    double largest_ = 0;
    double W_ = 1;  ///< At the film point of the last join.
};

/// Evaluates `sample` with the numbers of `source`; contributions go to `sink`.
void evaluate_sample(const PrimarySample& sample, int chain_class, NumberSource& source,
                     const ChainContext& c, ContributionSink& sink);

/// The numbers that a state has read.
struct NumberState : ChainState {
    NumberTable numbers;

    void save(LearnedState& to) const override {
        ChainState::save(to);
        numbers.save(to);
    }
    void load(LearnedState& from) override {
        ChainState::load(from);
        numbers.load(from);
    }
};

/// States that are functions of their numbers.
class NumberSpace : public StateSpace {
public:
    enum Mutation { Small, Block };
    static constexpr std::array<const char*, 2> kMutations{"small", "block"};

    /// A part `blocks` of the mutations are block steps; the others are of the kind `small`.
    explicit NumberSpace(int classes, NumberStep small = NumberStep::Small, double blocks = 0.05)
        : classes_(classes), small_(small), blocks_(blocks) {}

    int classes() const override { return classes_; }
    std::span<const char* const> mutations() const override { return kMutations; }
    void draw(int chain_class, uint64_t key, const ChainContext& c, ChainState& y) const override;
    Proposal propose(int chain_class, const ChainState& x, uint64_t key, const ChainContext& c,
                     ChainState& y) const override;

protected:
    /// Computes the state y from its numbers, which it reads from `source`.
    virtual void evaluate(int chain_class, NumberSource& source, const ChainContext& c,
                          ChainState& y) const = 0;

private:
    int classes_;
    NumberStep small_;
    double blocks_;
};

class PrimarySpace : public NumberSpace {
public:
    PrimarySpace(int classes, PrimarySample sample, TargetMap map)
        : NumberSpace(classes), sample_(std::move(sample)), map_(std::move(map)) {}

    std::unique_ptr<ChainState> make_state() const override {
        return std::make_unique<NumberState>();
    }
    void copy(const ChainState& from, ChainState& to) const override {
        static_cast<NumberState&>(to) = static_cast<const NumberState&>(from);
    }
    void repeat(int chain_class, const ChainState& x, const ChainContext& c,
                ContributionSink& sink) const override;

protected:
    void evaluate(int chain_class, NumberSource& source, const ChainContext& c,
                  ChainState& y) const override;
    const TargetMap& map() const { return map_; }

private:
    PrimarySample sample_;
    TargetMap map_;
};

}  // namespace etendue
