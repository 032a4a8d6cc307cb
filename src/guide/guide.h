#pragma once
// What guides the walks of a pass: learned directions at surfaces and at the start of light paths, and the choice of
// emitters. Frozen in a pass, and a function of earlier random numbers only, so that every pass is unbiased.

#include "guide/tree.h"
#include "math/distribution.h"

namespace etendue {

class Guide {
public:
    GuideTree surfaces;
    GuideTree emission;  ///< Of the directions from y_0, as TransportMode::Importance and class 0.

    /// Sets the relative probabilities with which light paths choose emitters, by Emitter::index.
    void set_emission(std::vector<double> weights) {
        emission_weights_ = std::move(weights);
        emission_choice_ = AliasTable(emission_weights_);
    }
    /// Whether this choice differs from that of next events.
    bool chooses_emitters() const { return !emission_choice_.empty(); }
    /// Where chooses_emitters(): the index of an emitter, and the probability of one.
    uint32_t sample_emitter(double u) const { return emission_choice_.sample(u).index; }
    float emission_pmf(uint32_t index) const { return emission_choice_.pmf(index); }

    size_t memory_bytes() const { return surfaces.memory_bytes() + emission.memory_bytes(); }

    template <class State>
    void save(State& to) const {
        surfaces.save(to);
        emission.save(to);
        to.put(emission_weights_);
    }
    template <class State>
    void load(State& from) {
        surfaces.load(from);
        emission.load(from);
        std::vector<double> weights;
        from.get(weights);
        set_emission(std::move(weights));
    }

private:
    std::vector<double> emission_weights_;
    AliasTable emission_choice_;
};

}  // namespace etendue
