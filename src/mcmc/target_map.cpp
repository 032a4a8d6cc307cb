#include "mcmc/target_map.h"

#include <algorithm>
#include <cmath>

#include "math/vec.h"

namespace etendue {
namespace {

/// Width of tiles of which each has about 64 samples, from 2 to 64 pixels.
int tile_width(const FilmGeometry& geometry, uint64_t samples) {
    constexpr double kSamples = 64;
    const double per_pixel = double(samples) / std::max(1.0, double(geometry.pixel_count()));
    return int(std::clamp(std::ceil(std::sqrt(kSamples / std::max(per_pixel, 1e-6))), 2.0, 64.0));
}

}  // namespace

TargetMap::TargetMap(const FilmGeometry& geometry, uint64_t samples)
    : geometry_(geometry), samples_(samples), tile_(tile_width(geometry, samples)),
      columns_((geometry.crop_width + tile_ - 1) / tile_),
      rows_((geometry.crop_height + tile_ - 1) / tile_), sums_(size_t(columns_) * size_t(rows_)),
      W_(size_t(columns_ + 1) * size_t(rows_ + 1), 1.0f) {}

void TargetMap::learn() {
    const auto pixels = [&](int tile, int size) { return std::min(tile_, size - tile * tile_); };
    double total = 0;
    std::vector<double> mean(sums_.size());
    for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < columns_; ++x) {
            const size_t i = size_t(y) * size_t(columns_) + size_t(x);
            const double area =
                double(pixels(x, geometry_.crop_width)) * double(pixels(y, geometry_.crop_height));
            mean[i] = sums_[i] / (double(samples_) * area);
            total += sums_[i];
        }
    const double average = total / (double(samples_) * double(geometry_.pixel_count()));
    const double floor2 = average > 0 ? 0.01 * sqr(average) : 1.0;
    // Smoothed by 1 2 1 in both directions, since a tile may have had few samples. The mean of square roots follows the
    // darker tiles: too large an L leaves a tile with few steps, too small an L only wastes some.
    for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < columns_; ++x) {
            double sum = 0, weights = 0;
            for (int v = std::max(0, y - 1); v <= std::min(rows_ - 1, y + 1); ++v)
                for (int u = std::max(0, x - 1); u <= std::min(columns_ - 1, x + 1); ++u) {
                    const double w = (u == x ? 2 : 1) * (v == y ? 2 : 1);
                    sum += w * std::sqrt(mean[size_t(v) * size_t(columns_) + size_t(u)]);
                    weights += w;
                }
            const double L = sqr(sum / weights);
            const auto W = float(1 / std::sqrt(L * L + floor2));
            for (const int v : {y, y + 1 == rows_ ? rows_ : y})
                for (const int u : {x, x + 1 == columns_ ? columns_ : x})
                    W_[size_t(v) * size_t(columns_ + 1) + size_t(u)] = W;
        }
}

double TargetMap::operator()(Vec2 film) const {
    // Between the centres of tiles.
    const float tiles = 1 / float(tile_);
    const auto centre = [tiles](float v, int count) {
        return std::min(std::max(v * tiles - 0.5f, 0.0f), float(count - 1));
    };
    const float x = centre(film.x - float(geometry_.crop_x), columns_),
                y = centre(film.y - float(geometry_.crop_y), rows_);
    const int left = int(x), top = int(y);
    const float u = x - float(left), v = y - float(top);
    const float* upper = &W_[size_t(top) * size_t(columns_ + 1) + size_t(left)];
    const float* lower = upper + columns_ + 1;
    return double((1 - v) * ((1 - u) * upper[0] + u * upper[1]) +
                  v * ((1 - u) * lower[0] + u * lower[1]));
}

}  // namespace etendue
