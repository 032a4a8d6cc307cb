#pragma once
// W: the factor of a contribution's luminance in the target of chains, as a function of the film point.

#include <vector>

#include "film/film_geometry.h"
#include "pathspace/learned_state.h"

namespace etendue {

/// W = 1/√(L² + 0.01 L̄²), where L is the luminance near a film point, estimated by a short run, and L̄ its mean. Chains then
/// distribute their steps by relative errors. 1 everywhere before learn().
class TargetMap {
public:
    explicit TargetMap(const FilmGeometry& geometry = {});
    /// Adds the luminance that a sample of the whole film contributes at a film point, in pixels.
    void add(Vec2 film, double luminance) { sums_[tile_at(film)] += luminance; }
    /// Sets L from the sums of `samples` samples. The sums are kept, so that more samples can be added.
    void learn(uint64_t samples);

    double operator()(Vec2 film) const;

    void save(LearnedState& to) const {
        to.put(geometry_);
        to.put(columns_);
        to.put(rows_);
        to.put(luminance_);
        to.put(floor2_);
    }
    void load(LearnedState& from) {
        from.get(geometry_);
        from.get(columns_);
        from.get(rows_);
        from.get(luminance_);
        from.get(floor2_);
    }

private:
    static constexpr int kTile = 16;  ///< Width and height of a tile in pixels.

    size_t tile_at(Vec2 film) const {
        const auto [x, y] = geometry_.pixel_near(film);
        return size_t(y / kTile) * size_t(columns_) + size_t(x / kTile);
    }

    FilmGeometry geometry_;
    int columns_, rows_;
    std::vector<double> sums_, luminance_;  ///< By tile.
    double floor2_ = 1;                     ///< 0.01 L̄²
};

}  // namespace etendue
