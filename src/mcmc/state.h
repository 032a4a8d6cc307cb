#pragma once
// States of Markov chains, and their spaces. chain.h and chain_groups.h use a method only through these interfaces.

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "mcmc/finds.h"
#include "pathspace/learned_state.h"
#include "pathspace/sample_context.h"

namespace etendue {

/// A weighted contribution of a state to the film.
struct Splat {
    Vec2 film;  ///< In pixels.
    Rgb value;
};

struct ChainState {
    /// I: the stationary density of the chain times the normalisation b, relative to the density of independent states, over
    /// which its mean is b. Positive if the state has a splat.
    double target = 0;
    int edges = 0;  ///< Length of the path with the largest part of the target, for statistics.
    std::vector<Splat> splats;

    virtual ~ChainState() = default;
    virtual void save(LearnedState& to) const {
        to.put(target);
        to.put(edges);
        to.put(splats);
    }
    virtual void load(LearnedState& from) {
        from.get(target);
        from.get(edges);
        from.get(splats);
    }
};

/// Context of the steps of one chain.
struct ChainContext {
    const SampleContext& sample;  ///< Of the whole film.
    Workspace& work;
};

/// A proposal y for a present state x.
struct Proposal {
    int mutation = 0;         ///< Index into StateSpace::mutations().
    bool has_failed = false;  ///< Nothing could be proposed, and y has the target 0.
    double Q_ratio =
        1;  ///< Q(y→x) / Q(x→y), relative to the density of independent states like targets.
};

/// A space of states of one or more classes, each with its own chains. All random numbers are functions of a key.
class StateSpace {
public:
    virtual ~StateSpace() = default;
    virtual int classes() const { return 1; }
    /// Names of the mutations that propose() makes.
    virtual std::span<const char* const> mutations() const = 0;
    virtual std::unique_ptr<ChainState> make_state() const = 0;
    virtual void copy(const ChainState& from, ChainState& to) const = 0;
    /// Sets y to an independent state.
    virtual void draw(int chain_class, uint64_t key, const ChainContext& c,
                      ChainState& y) const = 0;
    virtual Proposal propose(int chain_class, const ChainState& x, uint64_t key,
                             const ChainContext& c, ChainState& y) const = 0;
    /// Draws an independent sample and adds the states of all classes of which it consists; by default one of draw() for
    /// each class.
    virtual void sample(uint64_t key, const ChainContext& c, std::vector<Find>& finds) const;
    /// Sets y to a state that was found, by a sample or as a large step.
    virtual void recall(const Find& find, const ChainContext& c, ChainState& y) const {
        draw(find.chain_class, find.key, c, y);
    }
    /// Reports the contributions of x to `sink` again, with its sub-paths in c.work.
    virtual void repeat(int chain_class, const ChainState& x, const ChainContext& c,
                        ContributionSink& sink) const = 0;
    /// Adds `factor` times the contribution of x to the film.
    virtual void contribute(int chain_class, const ChainState& x, double factor,
                            const ChainContext& c, SplatSink& film) const;
};

/// Receives the states of a chain.
class StateSink {
public:
    virtual ~StateSink() = default;
    /// The contribution F of the state is to be multiplied by `factor` (see chain.h).
    virtual void add(const ChainState& state, double factor) = 0;
};

}  // namespace etendue
