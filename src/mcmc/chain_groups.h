#pragma once
// Groups of chains: how they start, whose turn it is, what their steps are worth.
//
// A group begins with a pool of independent samples. Its mean importance b_g is the normalisation, and the chains start at
// states of the pool, resampled by importance: then E[b_g h(x)] = ∫ I h for any size of the pool and after any number of
// steps that keep I, so there is no start-up bias [Veach 1997, §11.3.1]. This holds for the same pool's b_g only. What
// later large steps know of b comes from other groups: a pass of g is scaled by b_g plus the mean over all other groups h
// of b'_h - b_h, where b'_h is the mean over h's pool and all large steps of its earlier passes. That mean has
// expectation 0 and is independent of g, and over all groups the scales average to the mean of b'.

#include <functional>

#include "mcmc/chain.h"

namespace etendue {

struct ChainOptions {
    int groups = 16;
    int chains = 256;  ///< Of a group, all classes together.
    double p_large = 0.3;
};

/// What is fixed of a class before its chains begin.
struct ClassPlan {
    int chains = 0;
    uint64_t pool = 0;  ///< Samples.
    double c = 0;       ///< See chain.h.
};

class ChainGroups {
public:
    ChainGroups(const StateSpace& space, const ChainOptions& options, std::vector<ClassPlan> plan);

    /// Makes the steps of pass `pass.index`, which belong to group index mod groups: one a pixel, rounded up so that all
    /// chains make the same number. Nothing of it stays unless commit() follows.
    void advance(const PassContext& pass);
    /// The same with a place of its own for the states of each chain, instead of the film.
    using MakeSink = std::function<std::unique_ptr<StateSink>(
        uint64_t chain, int chain_class, const ChainContext& c, SplatSink& film)>;
    void advance(const PassContext& pass, const MakeSink& make_sink);
    void commit();

    /// All that later passes depend on. load() throws std::runtime_error where it is of other chains.
    void save(LearnedState& to) const;
    void load(LearnedState& from);

    /// Mean of b' over the groups that have begun, of all classes together, and its standard error relative to it.
    double b() const;
    double relative_error_of_b() const;
    /// Of all committed passes.
    const ChainStats& stats() const { return stats_; }
    /// Of the last pass: what b'_g alone would make of its splats, relative to what they are.
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
        uint64_t steps = 0;  ///< That each chain has made.
    };

    void start(const PassContext& pass, uint64_t key, Group& group) const;
    /// Of a pass of group g, which may have begun with this pass (`group`).
    double scale(size_t g, const Group& group, int chain_class) const;
    double later_b(const Group& group) const;

    const StateSpace& space_;
    ChainOptions options_;
    std::vector<ClassPlan> plan_;
    std::vector<int> class_of_chain_;
    std::vector<Group> groups_;
    Group working_;
    size_t working_group_ = 0;
    ChainStats working_stats_, stats_;
    double own_scale_ = 1;
};

/// Indices of `count` of the weighted items, by systematic resampling: item i comes count·w_i/Σw times in the mean.
std::vector<size_t> resample(std::span<const double> weights, size_t count, double u);

}  // namespace etendue
