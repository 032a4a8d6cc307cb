#pragma once
// Groups of chains: their start-up, their turns, and the scale of their contributions.
//
// A group starts with a pool of independent samples. The mean importance b_g of the pool is its normalisation, and its
// chains start at states of the pool, resampled in proportion to importance. Then E[b_g h(x)] = ∫ I h for any size of the
// pool and after any number of steps that leave I invariant, so there is no start-up bias [Veach 1997, §11.3.1]. This
// requires b_g to come from the same pool. Later samples and large steps improve the estimate of b through the other groups:
// a pass of g is scaled by b_g plus the mean of b'_h - b_h over all other groups h, where b'_h is the mean over the pool of h
// and all later samples and large steps of h. This mean has the expectation 0 and is independent of g. Averaged over all
// groups, the scale is the mean of b'.
//
// By generations, a group starts anew before its turns 0, 1, 4, 16 …, from everything that it has found so far: pool, later
// samples and large steps together are a larger pool. They are independent samples whose number does not depend on what they
// found, so that the above holds in each generation. Rare light then has its share of the chains by all finds, and not by
// those of the first pool, which chains may take longer to forget than the rendering takes. Nothing that the steps depend on
// may be learned from the finds. Groups use their own finds only, and remain independent of each other; since b_g h(x) is
// linear in the finds, the mean over the groups is that of one pool of all their finds. A large step counts as a given
// fraction of a sample in these means.
//
// If each pass has a target of its own, with random parameters (Starts::EachPass), its group starts anew in each pass.
// The estimates of b above then have the same expectation over these parameters for all groups.

#include <functional>

#include "mcmc/chain.h"

namespace etendue {

/// When the chains of a group start anew.
enum class Starts : uint8_t {
    Once,
    ByGeneration,
    EachPass,  ///< Because its target differs from that of earlier passes.
};

struct ChainOptions {
    int groups = 16;
    int chains = 256;  ///< Number in a group, for all classes together.
    double p_large = 0.3;
    double mutations = 1;  ///< Steps per pixel and pass, for all chains of a group together.
    Starts starts = Starts::ByGeneration;
    uint64_t pool = 1024;   ///< Number of samples in the first pool of a group.
    double later = 0;       ///< Later samples for each mutation.
    double large_step = 1;  ///< What a large step counts in pools, relative to a sample.
};

/// Parameters of a class that are fixed before its chains start.
struct ClassPlan {
    int chains = 0;
    double c = 0;  ///< See chain.h.
};

/// Plans for classes, of which a pilot found the parts `b_of_class` of b, and of which steps have these costs. Chains are
/// shared out in proportion to b_k/√cost. A class of which the pilot found little counts as a quarter of the mean: its
/// large steps may yet find light, which a constant c of zero would leave to chains that may never start.
std::vector<ClassPlan> share_out(double b, std::vector<double> b_of_class,
                                 std::span<const double> cost, int chains);

class ChainGroups {
public:
    ChainGroups(const StateSpace& space, const ChainOptions& options, std::vector<ClassPlan> plan);

    /// Makes the steps of pass `pass.index`, which belong to the group with the number index mod groups: `mutations` per
    /// pixel, rounded up so that all chains make the same number. The pass is discarded unless commit() follows.
    void advance(const PassContext& pass);
    /// The same, with a sink for the states of each chain instead of the film.
    using MakeSink = std::function<std::unique_ptr<StateSink>(
        uint64_t chain, int chain_class, const ChainContext& c, SplatSink& film)>;
    void advance(const PassContext& pass, const MakeSink& make_sink);
    void commit() noexcept;

    /// Everything that later passes depend on. load() throws std::runtime_error if the data belong to other chains.
    void save(LearnedState& to) const;
    void load(LearnedState& from);

    /// Mean of b' over the groups that have started, summed over the classes; and its relative standard error.
    double b() const;
    double relative_error_of_b() const;
    /// Statistics of all committed passes.
    const ChainStats& stats() const { return stats_; }
    /// For the last pass: the scale that b'_g alone would give, divided by the scale that was used.
    double own_scale() const { return own_scale_; }

private:
    /// Sums over the pool, and over what has come later.
    struct Normalisation {
        double pool_sum = 0, later_sum = 0;
        double pool = 0, later = 0;  ///< Numbers of samples.
        double b() const { return pool > 0 ? pool_sum / pool : 0.0; }
        double later_b() const { return pool > 0 ? (pool_sum + later_sum) / (pool + later) : 0.0; }
        /// Makes what has come later a part of the pool.
        void pool_all();
    };
    struct Group {
        std::vector<Chain> chains;                 ///< By class.
        std::vector<Normalisation> normalisation;  ///< By class, like `finds`.
        /// Of all samples and large steps, thinned out.
        std::vector<std::vector<Find>> finds;
        uint32_t turns = 0;  ///< Number of passes.

        bool has_begun() const { return turns > 0; }
    };

    struct TurnKeys;
    struct Turn;
    struct Steps;

    /// A turn of the group of the pass. Makes `working_` a copy of it.
    Turn begin_turn(const PassContext& pass);
    Steps step(const PassContext& pass, const Turn& turn, const MakeSink& make_sink);
    /// Adds what the steps have found to the pool.
    void settle(const Turn& turn, const Steps& made);

    /// Draws samples, as later ones of the pool.
    void sample(const PassContext& pass, uint64_t key, uint64_t count, Group& group) const;
    void thin_finds(uint64_t key, Group& group) const;
    void start(const PassContext& pass, uint64_t key, Group& group) const;
    /// Scale of a pass of group g; `group` is its state, since it may have started in this pass.
    double scale(size_t g, const Group& group, int chain_class) const;
    double later_b(const Group& group) const;
    /// Whether a group that was read has what one of these options has.
    bool is_consistent(const Group& group) const;

    const StateSpace& space_;
    ChainOptions options_;
    std::vector<ClassPlan> plan_;
    std::vector<int> class_of_chain_;
    std::vector<Group> groups_;
    Group working_;
    std::vector<Chain> spare_;  ///< For the group of the pass, if it has none.
    size_t working_group_ = 0;
    ChainStats working_stats_, stats_;
    double own_scale_ = 1;
};

}  // namespace etendue
