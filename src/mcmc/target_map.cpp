#include "mcmc/target_map.h"

#include "math/vec.h"

namespace etendue {

TargetMap::TargetMap(const FilmGeometry& geometry)
    : geometry_(geometry), columns_((geometry.crop_width + kTile - 1) / kTile),
      rows_((geometry.crop_height + kTile - 1) / kTile), sums_(size_t(columns_) * size_t(rows_)),
      luminance_(sums_.size()) {}

void TargetMap::learn(uint64_t samples) {
    const auto pixels = [](int tile, int size) { return std::min(kTile, size - tile * kTile); };
    double total = 0;
    std::vector<double> mean(sums_.size());
    for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < columns_; ++x) {
            const size_t i = size_t(y) * size_t(columns_) + size_t(x);
            const double area =
                double(pixels(x, geometry_.crop_width)) * double(pixels(y, geometry_.crop_height));
            mean[i] = sums_[i] / (double(samples) * area);
            total += sums_[i];
        }
    // Smoothed by 1 2 1 in both directions, since a tile may have had few samples.
    for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < columns_; ++x) {
            double sum = 0, weights = 0;
            for (int v = std::max(0, y - 1); v <= std::min(rows_ - 1, y + 1); ++v)
                for (int u = std::max(0, x - 1); u <= std::min(columns_ - 1, x + 1); ++u) {
                    const double w = (u == x ? 2 : 1) * (v == y ? 2 : 1);
                    sum += w * mean[size_t(v) * size_t(columns_) + size_t(u)];
                    weights += w;
                }
            luminance_[size_t(y) * size_t(columns_) + size_t(x)] = sum / weights;
        }
    const double average = total / (double(samples) * double(geometry_.pixel_count()));
    floor2_ = average > 0 ? 0.01 * sqr(average) : 1.0;
}

double TargetMap::operator()(Vec2 film) const {
    // Between the centres of tiles.
    const auto clamp = [](float v, int count) {
        return std::min(std::max(v / kTile - 0.5f, 0.0f), float(count - 1));
    };
    const float x = clamp(film.x - float(geometry_.crop_x), columns_),
                y = clamp(film.y - float(geometry_.crop_y), rows_);
    const int x0 = int(x), y0 = int(y);
    const int x1 = std::min(x0 + 1, columns_ - 1), y1 = std::min(y0 + 1, rows_ - 1);
    const double u = double(x) - x0, v = double(y) - y0;
    const auto at = [&](int column, int row) {
        return luminance_[size_t(row) * size_t(columns_) + size_t(column)];
    };
    const double L = (1 - v) * ((1 - u) * at(x0, y0) + u * at(x1, y0)) +
                     v * ((1 - u) * at(x0, y1) + u * at(x1, y1));
    return 1 / std::sqrt(L * L + floor2_);
}

}  // namespace etendue
