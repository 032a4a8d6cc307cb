#pragma once
// For every pixel of a run the pass in which it was brightest: the address, with the seed, of the sample behind a firefly.

#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
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

/// The value of a pass is the difference of two totals, so the film itself keeps nothing; it has a rounding error of 1e-7 of
/// the total, which is small beside what stands out. May be read from any thread.
class LargestPasses {
public:
    /// To be called after each pass, with a film whose passes are not of chains. Passes before the first call are not
    /// looked at, except that the film has only one. Without memory, nothing is kept from then on.
    void add(std::span<const Film::Moments> moments, uint64_t passes) noexcept;

    /// Number of passes that were looked at; with fewer than two, no pixel stands out.
    uint64_t passes() const;
    /// The pixel's brightest pass; empty with fewer than two passes, and where the pixel is black.
    std::optional<WorstPixel> at(uint64_t pixel) const;
    /// The `count` pixels in which one pass stands out most: by its part of the pixel's mean, relative to the pixel's mean
    /// without this pass or to a tenth of the image's mean, whichever is larger.
    std::vector<WorstPixel> worst(size_t count) const;

private:
    WorstPixel pixel(size_t i) const;

    mutable std::mutex mutex_;
    std::vector<float> sums_;     ///< Luminance of all passes of the film.
    std::vector<float> before_;   ///< Of those that were not looked at; empty if there are none.
    std::vector<float> largest_;  ///< Luminance of the brightest pass.
    std::vector<uint32_t> pass_;
    uint64_t seen_ = 0;  ///< Passes of the film at the last call.
    uint64_t counted_ = 0;
    bool has_failed_ = false;
};

}  // namespace etendue
