#pragma once
// The luminance of pixels in earlier passes, to which thresholds of Russian roulette are relative.

#include <cstdint>
#include <vector>

#include "film/film_geometry.h"

namespace etendue {

class ExpectedLuminance {
public:
    explicit ExpectedLuminance(const FilmGeometry& geometry)
        : geometry_(geometry), pixels_(geometry.pixel_count()) {}

    /// Mean luminance of a pixel in the passes before this generation, at least a tenth of the image's mean; 0 in the first one.
    float at(uint64_t pixel) const { return pixels_[pixel]; }
    /// The same at a film point (clamped to the crop), averaged over a block of pixels. Splats read this in random
    /// order; unlike the pixels, the blocks fit into the processor's cache.
    float at(Vec2 point) const {
        const auto [x, y] = geometry_.pixel_near(point);
        return blocks_[uint64_t(y / kBlock) * blocks_across() + uint64_t(x / kBlock)];
    }

private:
    friend class Film;
    static constexpr int kBlock = 4;

    uint64_t blocks_across() const { return uint64_t(geometry_.crop_width + kBlock - 1) / kBlock; }
    void average_blocks();

    FilmGeometry geometry_;
    std::vector<float> pixels_;
    std::vector<float> blocks_;  ///< Means of kBlock × kBlock pixels; empty until there are splats.
};

}  // namespace etendue
