#pragma once
// States of Markov chains, and the spaces they move in. The engine (chain.h, chain_groups.h) knows nothing else of a method.

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "pathspace/learned_state.h"
#include "pathspace/sample_context.h"

namespace etendue {

/// What a state adds to the film, weighted.
struct Splat {
    Vec2 film;
    Rgb value;
};

struct ChainState {
    /// I: the chain's density times the normalisation b. Positive wherever a splat is.
    double target = 0;
    /// T: density of this state among independent ones, in the measure of I. 1 in primary sample space.
    double independent_density = 1;
    int edges = 0;  ///< Length of the path that has the largest part of the target; for statistics.
    std::vector<Splat> splats;

    virtual ~ChainState() = default;
    virtual void save(LearnedState& to) const {
        to.put(target);
        to.put(independent_density);
        to.put(edges);
        to.put(splats);
    }
    virtual void load(LearnedState& from) {
        from.get(target);
        from.get(independent_density);
        from.get(edges);
        from.get(splats);
    }
    /// I/T, whose mean over independent states is b.
    double importance() const { return target / independent_density; }
};

/// What a task of one chain works with.
struct ChainContext {
    const SampleContext& sample;  ///< Of the whole film.
    Workspace& work;
};

/// A proposal y for a present state x.
struct Proposal {
    int mutation = 0;         ///< Index into StateSpace::mutations().
    bool has_failed = false;  ///< Nothing could be proposed: x stays.
    double Q_ratio = 1;       ///< Q(y→x) / Q(x→y).
};

/// States of one or more classes; every class has chains of its own. All random numbers are functions of a key.
class StateSpace {
public:
    virtual ~StateSpace() = default;
    virtual int classes() const { return 1; }
    /// Names of what propose() may do.
    virtual std::span<const char* const> mutations() const = 0;
    virtual std::unique_ptr<ChainState> make_state() const = 0;
    virtual void copy(const ChainState& from, ChainState& to) const = 0;
    /// Makes y an independent state, distributed by T.
    virtual void draw(int chain_class, uint64_t key, const ChainContext& c,
                      ChainState& y) const = 0;
    virtual Proposal propose(int chain_class, const ChainState& x, uint64_t key,
                             const ChainContext& c, ChainState& y) const = 0;
    /// Makes x's contributions again, to `sink`, with its sub-paths in c.work.
    virtual void repeat(int chain_class, const ChainState& x, const ChainContext& c,
                        ContributionSink& sink) const = 0;
    /// Adds `factor` times what x brings to the film.
    virtual void contribute(int chain_class, const ChainState& x, double factor,
                            const ChainContext& c, SplatSink& film) const;
};

/// Where the states of a chain go.
class StateSink {
public:
    virtual ~StateSink() = default;
    /// F of the state counts so many times (see chain.h).
    virtual void add(const ChainState& state, double factor) = 0;
};

}  // namespace etendue
