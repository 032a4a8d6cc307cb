#pragma once
// Photons from the states of Markov chains, for metropolis_photons.h. Each target function has its own kind of states, which
// store photons.

#include <unordered_map>

#include "integrator/photon_source.h"
#include "mcmc/state.h"
#include "mcmc/whole_film.h"

namespace etendue {

/// The maps that store a photon.
struct Maps {
    bool global, caustic;
};

/// Makes photons from the states of one chain.
class PhotonDeposits : public StateSink {
public:
    struct Result {
        MapPhotons photons;
        uint64_t reciprocals = 0, trials = 0;  ///< Number of estimates of 1/P, and of their trials.
    };
    struct Terms {
        double unit;         ///< Factor times target of a state that stays for one step.
        double least_share;  ///< Photons with a smaller share of it pass roulette.
        uint64_t key;
        PhotonMemory& memory;
        Result& out;
    };
    explicit PhotonDeposits(const Terms& terms) : terms_(terms) {}

    void add(const ChainState& state, double factor) final;

protected:
    /// Stores the photons of a state: their flux relative to T, times `factor`. `steps`: for how many steps it stays.
    virtual void deposit(const ChainState& state, double factor, double steps, uint64_t key) = 0;
    void store(const MapPhoton& photon, Maps maps);
    Result& out() { return terms_.out; }

private:
    /// Photons of a chain in a map. Where a proposal is rejected, or keeps the beginning of the path, a photon comes
    /// again: its power is added to the one that is stored [Fan et al. 2005, §3.2]. Otherwise all photons of a density
    /// estimate could be at one point.
    class Repeats {
    public:
        /// Whether the photon is a new one.
        bool store(const MapPhoton& photon, std::vector<MapPhoton>& map);

    private:
        std::unordered_map<uint64_t, size_t> places_;  ///< Indices in the map.
    };

    Terms terms_;
    uint64_t number_ = 0;
    Repeats global_, caustic_;
};

/// The same for two photons at one point that arrive along one direction, after equally many edges.
uint64_t place_key(const MapPhoton& photon);

/// States of chains that store photons.
class PhotonStates {
public:
    virtual ~PhotonStates() = default;
    virtual const StateSpace& space() const = 0;
    virtual std::unique_ptr<PhotonDeposits> deposits(const PhotonDeposits::Terms& terms,
                                                     const ChainContext& c) const = 0;
};

/// Calls use(i, c) for independent samples in parallel.
template <class Use>
void for_each_independent(const PassContext& context, uint64_t count, const Use& use) {
    context.for_each_other_path(count, [&](uint64_t i, Sampler&, Workspace& work) {
        const WholeFilm whole(context);
        use(i, ChainContext{whole.sample, work});
    });
}

}  // namespace etendue
