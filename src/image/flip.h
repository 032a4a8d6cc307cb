#pragma once
// FLIP: the difference a viewer sees who flips between two images [Andersson et al. 2020, 2021].

#include <span>
#include <vector>

#include "color/rgb.h"

namespace etendue {

/// Pixels per degree of a 0.7 m wide display of 3840 pixels seen from 0.7 m [Andersson et al. 2020, §4].
inline constexpr float kFlipPixelsPerDegree = 67.0206f;

struct FlipResult {
    std::vector<float> map;  ///< Per pixel, in [0, 1]; 1 where either image is not finite.
    double mean = 0;
};

/// LDR-FLIP of displayed images, linear colours that are clamped to [0, 1].
FlipResult ldr_flip(std::span<const Rgb> image, std::span<const Rgb> reference, int width,
                    int height, float pixels_per_degree = kFlipPixelsPerDegree);

/// HDR-FLIP: per pixel the largest LDR-FLIP over flip_exposures(reference), tone-mapped by the ACES curve.
FlipResult hdr_flip(std::span<const Rgb> image, std::span<const Rgb> reference, int width,
                    int height, float pixels_per_degree = kFlipPixelsPerDegree);

/// Exposures of HDR-FLIP for a reference, in stops and ascending [Andersson et al. 2021, §3.2].
std::vector<float> flip_exposures(std::span<const Rgb> reference);

}  // namespace etendue
