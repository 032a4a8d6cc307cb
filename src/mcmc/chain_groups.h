#pragma once
// Groups of chains: their start-up, their turns, and the scale of their contributions.
//
// A group starts with a pool of independent samples. The mean importance b_g of the pool is its normalisation, and its
// chains start at states of the pool, resampled in proportion to importance. Then E[b_g h(x)] = ∫ I h for any size of the
// pool and after any number of steps that leave I invariant, so there is no start-up bias [Veach 1997, §11.3.1]. This
// requires b_g to come from the same pool. Later large steps improve the estimate of b through the other groups: a pass of
// g is scaled by b_g plus the mean of b'_h - b_h over all other groups h, where b'_h is the mean over the pool of h and all
// large steps of its earlier passes. This mean has the expectation 0 and is independent of g. Averaged over all groups, the
// scale is the mean of b'.
//
// If each pass has a target of its own, with random parameters (ChainOptions::restarts), its group starts anew in each pass.
// The estimates of b above then have the same expectation over these parameters for all groups.

#include <functional>

#include "mcmc/chain.h"

namespace etendue {

struct ChainOptions {
    int groups = 16;
    int chains = 256;  ///< Number in a group, for all classes together.
    double p_large = 0.3;
    double mutations = 1;  ///< Steps per pixel and pass, for all chains of a group together.
    /// Whether each pass starts its group anew, because its target differs from that of earlier passes.
    bool restarts = false;
};

/// Parameters of a class that are fixed before its chains start.
struct ClassPlan {
    int chains = 0;
    uint64_t pool = 0;  ///< Number of samples in the pool.
    double c = 0;       ///< See chain.h.
};

/// Plans for classes, of which a pilot found the parts `b_of_class` of b, and of which steps have these costs. Chains are
/// shared out in proportion to b_k/√cost. A class of which the pilot found little counts as a quarter of the mean: its
/// large steps may yet find light, which a constant c of zero would leave to chains that may never start.
std::vector<ClassPlan> share_out(double b, std::vector<double> b_of_class,
                                 std::span<const double> cost, uint64_t pool, int chains);

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
    struct Normalisation {
        double pool_sum = 0, large_sum = 0;
        uint64_t pool = 0, large = 0;
        double b() const { return pool > 0 ? pool_sum / double(pool) : 0.0; }
        double later_b() const {
            return pool > 0 ? (pool_sum + large_sum) / double(pool + large) : 0.0;
        }
    };
    struct Group {
        std::vector<Chain> chains;  ///< By class.
        std::vector<Normalisation> normalisation;
        uint64_t steps = 0;  ///< Number of steps that each chain has made.
    };

    void start(const PassContext& pass, uint64_t key, Group& group) const;
    /// Scale of a pass of group g; `group` is its state, since it may have started in this pass.
    double scale(size_t g, const Group& group, int chain_class) const;
    double later_b(const Group& group) const;

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

/// Draws `count` indices of weighted items by systematic resampling: item i occurs count·w_i/Σw times on average.
std::vector<size_t> resample(std::span<const double> weights, size_t count, double u);

}  // namespace etendue
