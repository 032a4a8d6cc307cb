#pragma once
// Places at which the light of lamps arrives by delta events alone. They tell where the chains begin that an eye vertex near
// them needs: in light that is focused most photons arrive by the chains that carry most of it.

#include <span>
#include <vector>

#include "guide/kd_splits.h"
#include "guide/placed_density.h"

namespace etendue {

struct SeedPhoton {
    Vec3 p, n;         ///< n: normal on the side at which it arrives (see PlacedWeight).
    Vec3 left;         ///< The point of the last delta event.
    uint32_t emitter;  ///< Emitter::index
};

class SeedPhotons {
public:
    SeedPhotons() = default;
    /// The same for the same photons in the same order.
    explicit SeedPhotons(std::vector<SeedPhoton> photons);

    /// Those of the emitter with this index, on the side with the normal `n`, in the leaf of a k-d tree that holds `p`.
    std::span<const SeedPhoton> near(Vec3 p, Vec3 n, uint32_t emitter) const;
    size_t size() const { return photons_.size(); }

    template <class State>
    void save(State& to) const {
        splits_.save(to);
        to.put(photons_);
        to.put(begin_);
    }
    template <class State>
    void load(State& from) {
        splits_.load(from);
        from.get(photons_);
        from.get(begin_);
    }

private:
    KdSplits splits_;
    std::vector<SeedPhoton> photons_;  ///< By leaf, side and emitter.
    std::vector<uint32_t> begin_;      ///< By leaf and side, and the end.
};

}  // namespace etendue
