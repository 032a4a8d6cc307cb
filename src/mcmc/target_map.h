#pragma once
// W: what a contribution's luminance counts in the target of chains, by film point.

#include <vector>

#include "film/film_geometry.h"

namespace etendue {

/// W = 1/√(L² + 0.01 L̄²), where L is what a short run knows of the luminance near a point: chains then spend their steps
/// by relative errors. 1 everywhere until it has learned.
class TargetMap {
public:
    /// `points`: film points with luminance, together from `samples` samples of the whole film.
    struct Point {
        Vec2 film;
        double luminance;
    };
    explicit TargetMap(const FilmGeometry& geometry);
    void add(const Point& p) { sums_[tile_at(p.film)] += p.luminance; }
    /// Ends the run. What was added stays, and add() may go on.
    void learn(uint64_t samples);

    double operator()(Vec2 film) const;

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
