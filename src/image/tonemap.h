#pragma once
// Tone mapping of linear colours to linear display colours in [0, 1], and false colours.

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "color/rgb.h"

namespace etendue {

enum class ToneOperator {
    Srgb,      ///< Only clamps.
    Reinhard,  ///< Global, with a white point [Reinhard et al. 2002, eq. 4], on luminance.
    Aces,      ///< Fit of the ACES reference transforms [Narkowicz 2016], on each channel.
};
std::optional<ToneOperator> tone_operator(std::string_view name);  ///< "srgb", "reinhard", "aces"

struct ToneMapping {
    ToneOperator op = ToneOperator::Srgb;
    float exposure = 0;  ///< Stops: colours are multiplied by 2^exposure first.
    /// Luminance, after exposure, that Reinhard maps to white; 0: the largest in the image.
    float white = 0;
};
/// Luminances of the colours that are finite.
std::vector<float> finite_luminances(std::span<const Rgb> pixels);

/// A mapping of the colours of one image to linear colours in [0, 1]; NaN stays NaN.
class ToneCurve {
public:
    /// `largest`: the largest finite luminance of the image, for ToneMapping::white.
    ToneCurve(const ToneMapping& mapping, float largest);
    Rgb operator()(Rgb c) const;

private:
    ToneOperator op_;
    float scale_;
    double white_;
};
std::vector<Rgb> tone_map(std::span<const Rgb> pixels, const ToneMapping& mapping);

/// Exposure, in stops, that maps the 95th percentile of the luminance to 0.8; a multiple of 1/4. 0 for black images.
float auto_exposure(std::vector<float> luminances);
inline float auto_exposure(std::span<const Rgb> pixels) {
    return auto_exposure(finite_luminances(pixels));
}

/// The rational function of [Narkowicz 2016] at 0.6 x, the scale he recommends; clamped to [0, 1].
float aces_curve(float x);
/// The larger x that the unclamped aces_curve() maps to y in [0, 1).
double inverse_aces_curve(double y);

/// Colour map "magma" of matplotlib (van der Walt, Smith; CC0) at v clamped to [0, 1], as linear sRGB; NaN stays NaN.
Rgb magma(float v);

}  // namespace etendue
