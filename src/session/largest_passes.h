#pragma once
// For every pixel of a run the pass in which it was brightest: the address, with the seed, of the sample behind a firefly.

#include <cstdint>
#include <optional>
#include <vector>

#include "film/film.h"

namespace etendue {

/// A pixel that owes much of its value to one pass.
struct WorstPixel {
    uint64_t pixel = 0;  ///< Index within the crop.
    uint32_t pass = 0;   ///< Counted from the first pass of the run.
    float value = 0;     ///< Luminance of the pixel in this pass.
    float share = 0;     ///< Of the pixel's sum over the passes that were looked at.
};

/// What a film had when it began to note its largest passes.
struct SumsBefore {
    uint64_t passes = 0;
    std::vector<float> luminance;  ///< Sum of these passes, by pixel; empty if there are none.

    static SumsBefore of(const Film& film);
};

/// A look at the largest passes of a film, between its passes or while one is traced.
class LargestPasses {
public:
    /// `film`: nullptr, or one that does not keep them, if nothing is known. Both must outlive this.
    LargestPasses(const Film* film, const SumsBefore& before);

    /// Number of passes that were looked at; with fewer than two, no pixel stands out.
    uint64_t passes() const { return passes_; }
    /// The pixel's brightest pass; empty with fewer than two passes, and where the pixel is black.
    std::optional<WorstPixel> at(uint64_t pixel) const;
    /// The `count` pixels in which one pass stands out most: by its part of the pixel's mean, relative to the pixel's mean
    /// without this pass or to a tenth of the image's mean, whichever is larger.
    std::vector<WorstPixel> worst(size_t count) const;

private:
    /// Luminance of a pixel, summed over the passes that were looked at.
    float sum(uint64_t pixel) const;
    WorstPixel pixel(uint64_t pixel) const;

    const Film* film_;
    const SumsBefore& before_;
    uint64_t passes_;
};

}  // namespace etendue
