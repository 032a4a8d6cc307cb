#pragma once
// W: what a contribution's luminance counts in the target of chains, by film point.

#include <vector>

#include "film/film_geometry.h"
#include "pathspace/learned_state.h"

namespace etendue {

/// W = 1/√(L² + 0.01 L̄²), where L is what a short run knows of the luminance near a point: chains then spend their steps
/// by relative errors. 1 everywhere until it has learned.
class TargetMap {
public:
    explicit TargetMap(const FilmGeometry& geometry = {});
    /// What samples of the whole film bring to a point.
    void add(Vec2 film, double luminance) { sums_[tile_at(film)] += luminance; }
    /// Sets L from the sums of so many samples. What was added stays, and add() may go on.
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
    static constexpr int kTile = 16;  ///< Pixels, across.

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
