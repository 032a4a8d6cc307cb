#pragma once
// The space of full paths for Markov chains [Veach 1997, ch. 11]: large steps sample a path by one technique, and mutations
// change a part of it.

#include "mcmc/mutation/mutation.h"

namespace etendue {

class PathSpace final : public StateSpace {
public:
    PathSpace(PathTarget target, const PathMutations& mutations, TechniqueCounts counts);

    std::span<const char* const> mutations() const override { return PathMutations::kNames; }
    std::unique_ptr<ChainState> make_state() const override {
        return std::make_unique<PathState>(target_);
    }
    void copy(const ChainState& from, ChainState& to) const override {
        static_cast<PathState&>(to).copy(static_cast<const PathState&>(from));
    }
    void draw(int chain_class, uint64_t key, const ChainContext& c, ChainState& y) const override;
    Proposal propose(int chain_class, const ChainState& x, uint64_t key, const ChainContext& c,
                     ChainState& y) const override;
    void repeat(int chain_class, const ChainState& x, const ChainContext& c,
                ContributionSink& sink) const override;

private:
    using Kind = PathMutations::Kind;
    bool draw_user_path(PathBuilder& builder, Sampler& sampler) const;
    MutationChoices choices(const PathState& x) const;
    /// Q of all proposals that make y from x in this way; `x.choices` are known.
    PathDensity Q(Kind kind, const PathState& x, const PathState& y, const MutationWay& way) const;

    PathTarget target_;
    PathMutations options_;
    std::array<std::unique_ptr<PathMutation>, PathMutations::kCount> mutations_;
    TechniqueCounts counts_;  ///< For the MIS weights of the joins that repeat() reports.
};

}  // namespace etendue
