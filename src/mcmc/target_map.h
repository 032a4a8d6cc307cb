#pragma once
// W: the factor of a contribution's luminance in the target of chains, as a function of the film point.

#include <vector>

#include "film/film_geometry.h"
#include "pathspace/learned_state.h"

namespace etendue {

/// W = 1/√(L² + 0.01 L̄²), where L is the luminance near a film point, estimated by a short run, and L̄ its mean. Chains then
/// distribute their steps by relative errors. 1 everywhere before learn().
///
/// L is a mean over square tiles. If a tile holds bright and dark pixels, the dark ones get too few steps; tiles are thus as
/// small as the number of samples allows.
class TargetMap {
public:
    /// `samples` is the number of samples of the whole film that will be added.
    explicit TargetMap(const FilmGeometry& geometry = {}, uint64_t samples = 0);
    /// Adds the luminance that a sample of the whole film contributes at a film point, in pixels.
    void add(Vec2 film, double luminance) { sums_[tile_at(film)] += luminance; }
    /// Sets W from the sums.
    void learn();

    double operator()(Vec2 film) const;

    void save(LearnedState& to) const {
        to.put(geometry_);
        to.put(tile_);
        to.put(columns_);
        to.put(rows_);
        to.put(W_);
    }
    void load(LearnedState& from) {
        from.get(geometry_);
        from.get(tile_);
        from.get(columns_);
        from.get(rows_);
        from.get(W_);
    }

private:
    size_t tile_at(Vec2 film) const {
        const auto [x, y] = geometry_.pixel_near(film);
        return size_t(y / tile_) * size_t(columns_) + size_t(x / tile_);
    }

    FilmGeometry geometry_;
    uint64_t samples_;
    int tile_;  ///< Width and height of a tile in pixels.
    int columns_, rows_;
    std::vector<double> sums_;  ///< By tile.
    /// At the centres of tiles. The last row and column are there twice, so that each centre has one to its right and below.
    std::vector<float> W_;
};

}  // namespace etendue
