#pragma once
// Learned selection of the emitters of next events, by place [after Vévoda et al. 2018].

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "guide/kd_splits.h"
#include "guide/placed_density.h"
#include "math/distribution.h"

namespace etendue {

/// What a light path brought to the first surface that it met.
struct Arrival {
    PlacedWeight at;
    uint32_t emitter = 0;  ///< Emitter::index
};

/// The probabilities with which next events select emitters at one place: a mixture of learned ones and those that hold
/// everywhere, so that none is lost that the training has not met.
class LightSelection {
public:
    LightSelection() = default;
    /// Learned probabilities in proportion to `weights` (positive), of `emitters` in ascending order; `share` of all selections.
    LightSelection(float share, std::vector<uint32_t> emitters, std::span<const double> weights)
        : share_(share), emitters_(std::move(emitters)), choice_(weights) {}

    float share() const { return share_; }
    /// The probability of an emitter, where the one that holds everywhere is `everywhere`.
    float pmf(uint32_t emitter, float everywhere) const;
    struct Draw {
        std::optional<uint32_t> emitter;  ///< Empty: to be selected as everywhere, by `u`.
        double u;                         ///< The argument rescaled to [0, 1).
    };
    Draw sample(double u) const;
    size_t memory_bytes() const;

private:
    float share_ = 0;
    std::vector<uint32_t> emitters_;
    AliasTable choice_;
};

/// The selections of all places: a place is a side of the surfaces in a leaf of a k-d tree.
class LightSelections {
public:
    LightSelections() = default;
    /// `pmf` has the probabilities that hold everywhere, by Emitter::index. A function of the arrivals and their order. Weights
    /// that are not positive and finite do not count.
    LightSelections(std::vector<Arrival> arrivals, const std::vector<float>& pmf);

    bool is_empty() const { return selections_.empty(); }
    /// At `p` on the side `n` (see PlacedWeight); nullptr where nothing was learned. Not where it is empty.
    const LightSelection* find(Vec3 p, Vec3 n) const {
        const uint32_t i = by_place_[place(p, n)];
        return i == kNone ? nullptr : &selections_[i];
    }
    /// Mean over the light that arrives of log(learned probability of its emitter / that of everywhere), in nats; estimated by
    /// arrivals that were left out of the training.
    float gain() const { return gain_; }
    size_t memory_bytes() const;

    template <class State>
    void save(State& to) const {
        splits_.save(to);
        to.put(uint64_t(by_place_.size()));
        to.put(learned_);
        to.put(counts_);
        to.put(gain_);
    }
    template <class State>
    void load(State& from) {
        splits_.load(from);
        uint64_t places = 0;
        from.get(places);
        from.get(learned_);
        from.get(counts_);
        from.get(gain_);
        tabulate(size_t(places));
    }

private:
    static constexpr uint32_t kNone = ~0u;
    /// Weight of an emitter at a place; in ascending order of both.
    struct Placed {
        uint32_t place, emitter;
        double weight;
    };
    /// Arrivals at a place.
    struct Count {
        uint32_t place, arrivals;
    };
    size_t place(Vec3 p, Vec3 n) const { return splits_.leaf(p) * kSurfaceSides + surface_side(n); }
    void set(std::vector<Placed> arrivals, size_t places);
    void tabulate(size_t places);

    KdSplits splits_;
    std::vector<Placed> learned_;
    std::vector<Count> counts_;
    std::vector<uint32_t> by_place_;  ///< Indices of selections_, or kNone.
    std::vector<LightSelection> selections_;
    float gain_ = 0;
};

}  // namespace etendue
