#pragma once
// The space of full paths for Markov chains [Veach 1997, ch. 11]: large steps sample a path by one technique, and mutations
// change a part of it.

#include "mcmc/mutation/mutation.h"
#include "mcmc/weighed_sample.h"

namespace etendue {

/// Mutations in path space, and their weights: one of those that can change a path is chosen in proportion.
/// That of UserPath must be 0 if the target has no user paths.
struct PathMutations {
    enum Kind : int {
        Bidirectional,
        Lens,
        Caustic,
        MultiChain,
        GlossyLens,
        GlossyCaustic,
        Manifold,
        LensSubpath,
        UserPath,
        PhotonMap,
        kCount
    };
    static constexpr std::array<const char*, kCount> kNames{
        "bidirectional",  "lens",     "caustic",      "multi_chain", "glossy_lens",
        "glossy_caustic", "manifold", "lens_subpath", "user_path",   "photon_map"};
    std::array<double, kCount> weights{1, 4, 4, 4, 4, 4, 4, 0.5, 0, 0};
};

class PathSpace final : public StateSpace {
public:
    /// `samples` are those of bidirectional path tracing, in which chains find their first states; if it is not given, they
    /// find them in large steps.
    PathSpace(PathTarget target, const PathMutations& mutations, TechniqueCounts counts,
              std::optional<WeighedSample> samples = {});

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
    void sample(uint64_t key, const ChainContext& c, std::vector<Find>& finds) const override;
    void recall(const Find& find, const ChainContext& c, ChainState& y) const override;
    void repeat(int chain_class, const ChainState& x, const ChainContext& c,
                ContributionSink& sink) const override;

private:
    using Kind = PathMutations::Kind;
    bool draw_user_path(PathBuilder& builder, Sampler& sampler) const;
    /// Probability of each mutation at a state.
    using Choices = std::array<double, PathMutations::kCount>;
    Choices choices(const PathState& x) const;
    /// `at_x` is choices(x).
    PathDensity Q(Kind kind, const Choices& at_x, const PathState& x, const PathState& y,
                  const MutationWay& way) const;

    PathTarget target_;
    PathMutations options_;
    std::array<std::unique_ptr<PathMutation>, PathMutations::kCount> mutations_;
    std::optional<WeighedSample> samples_;
    TechniqueCounts counts_;  ///< For the MIS weights of the joins that repeat() reports.
};

}  // namespace etendue
