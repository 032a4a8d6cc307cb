#pragma once
// What guides the walks of a pass: learned directions at surfaces and at the start of light paths, and the choice of
// emitters by light paths and by next events. Frozen in a pass, and a function of earlier random numbers only, so that every
// pass is unbiased.

#include "guide/light_selection.h"
#include "guide/tree.h"
#include "math/distribution.h"

namespace etendue {

class Guide {
public:
    /// The directions from which an emitter at infinity sends light, as class 0.
    struct AtInfinity {
        uint32_t emitter;  ///< Emitter::index
        GuideFit fit;

        template <class Learned, class Use>
        static void for_each_field(Learned& learned, const Use& use) {
            auto& [emitter, fit] = learned;
            use(emitter), use(fit);
        }
    };

    GuideTree surfaces;
    bool uses_surfaces = true;  ///< Whether walks take directions from `surfaces`.
    GuideTree emission;  ///< Of the directions from y_0, as TransportMode::Importance and class 0.
    /// Whether walks use adjoint-driven Russian roulette [Vorba & Křivánek 2016], by GuideCell::Field::contribution.
    bool has_roulette = false;
    /// Mean contribution of light walks to the sum of all pixels, in the same unit.
    float light_contribution = 0;
    float emission_gain =
        0;  ///< Mean gain of all light paths by the directions from y_0, or of y_0 at infinity.

    LightSelections lights;  ///< Of next events.

    /// Whether walks have directions and densities of a cell at each surface.
    bool guides_surfaces() const { return uses_surfaces && !surfaces.is_empty(); }
    /// Whether walks look up a cell at each surface, for its directions or for its roulette.
    bool has_cells() const { return (uses_surfaces || has_roulette) && !surfaces.is_empty(); }
    /// The learned selection of emitters at `p`, on the side `n` (see PlacedWeight); nullptr where there is none.
    const LightSelection* lights_at(Vec3 p, Vec3 n) const {
        return lights.is_empty() ? nullptr : lights.find(p, n);
    }

    void add_at_infinity(const AtInfinity& learned) { at_infinity_.push_back(learned); }
    /// The learned directions of an emitter at infinity; nullptr where their share is 0.
    const GuideFit* at_infinity(uint32_t emitter) const {
        for (const AtInfinity& a : at_infinity_)
            if (a.emitter == emitter) return a.fit.share[0] > 0 ? &a.fit : nullptr;
        return nullptr;
    }

    /// Prepares it for walks that only train: they are guided wherever they gain a little, and none is ended early.
    void make_teacher() {
        uses_surfaces = true;
        has_roulette = false;
        surfaces.use_training_shares();
        emission.use_training_shares();
        for (AtInfinity& a : at_infinity_) a.fit.share = a.fit.training_share;
    }

    /// Sets the relative probabilities with which light paths choose emitters, by Emitter::index.
    void set_emission(std::vector<double> weights) {
        emission_weights_ = std::move(weights);
        emission_choice_ = AliasTable(emission_weights_);
    }
    /// Whether this choice differs from Emitter::selection_pmf.
    bool chooses_emitters() const { return !emission_choice_.empty(); }
    /// Where chooses_emitters(): the index of an emitter, and the probability of one.
    uint32_t sample_emitter(double u) const { return emission_choice_.sample(u).index; }
    float emission_pmf(uint32_t index) const { return emission_choice_.pmf(index); }

    size_t memory_bytes() const {
        return surfaces.memory_bytes() + emission.memory_bytes() + lights.memory_bytes() +
               at_infinity_.capacity() * sizeof(AtInfinity);
    }

    template <class State>
    void save(State& to) const {
        surfaces.save(to);
        to.put(uses_surfaces);
        emission.save(to);
        to.put(has_roulette);
        to.put(light_contribution);
        to.put(emission_gain);
        to.put(at_infinity_);
        to.put(emission_weights_);
        lights.save(to);
    }
    template <class State>
    void load(State& from) {
        surfaces.load(from);
        from.get(uses_surfaces);
        emission.load(from);
        from.get(has_roulette);
        from.get(light_contribution);
        from.get(emission_gain);
        from.get(at_infinity_);
        std::vector<double> weights;
        from.get(weights);
        set_emission(std::move(weights));
        lights.load(from);
    }

private:
    std::vector<AtInfinity> at_infinity_;
    std::vector<double> emission_weights_;
    AliasTable emission_choice_;
};

}  // namespace etendue
