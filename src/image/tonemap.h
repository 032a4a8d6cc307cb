#pragma once
// From linear colours to those of a display, still linear and in [0, 1]; and false colours.

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "color/rgb.h"

namespace etendue {

enum class ToneOperator {
    Srgb,      ///< Clamping alone.
    Reinhard,  ///< Global, with a white point [Reinhard et al. 2002, eq. 4], on luminance.
    Aces,      ///< Fit of the ACES reference transforms [Narkowicz 2016], on each channel.
};
std::optional<ToneOperator> tone_operator(std::string_view name);  ///< "srgb", "reinhard", "aces"

struct ToneMapping {
    ToneOperator op = ToneOperator::Srgb;
    float exposure = 0;  ///< Stops: colours are multiplied by 2^exposure first.
    float white =
        0;  ///< Luminance, after exposure, that becomes white under Reinhard; 0: the image's largest.
};
/// In [0, 1], linear; not-a-number stays as it is.
std::vector<Rgb> tone_map(std::span<const Rgb> pixels, const ToneMapping& mapping);

/// The rational function of [Narkowicz 2016], for x that is scaled by 0.6 as there; clamped to [0, 1].
float aces_curve(float x);
/// The largest x that the unclamped aces_curve maps to y in [0, 1).
double inverse_aces_curve(double y);

/// Colour map "magma" of matplotlib (van der Walt, Smith; CC0), for v clamped to [0, 1]; linear sRGB. Not-a-number stays.
Rgb magma(float v);

}  // namespace etendue
