#pragma once
// Spectra of Mitsuba scenes as linear sRGB.

#include "readers/mitsuba_values.h"

namespace etendue {

/// The quantity that a spectrum describes; it determines the illuminant and the range.
enum class SpectrumRole {
    Emission,     ///< Radiance, irradiance, ...; no illuminant.
    Reflectance,  ///< A ratio in [0, 1], seen under D65.
    Ratio,  ///< Without an upper bound (an index of refraction, a factor, absorption), seen under D65.
};

/// The role of a spectrum that is a parameter of an object of this category.
SpectrumRole spectrum_role(std::string_view category, std::string_view parameter, bool in_emitter);

Rgb spectrum_colour(const SpectrumSamples& samples, SpectrumRole role);

/// The colour of <spectrum type="...">: blackbody, uniform, d65, irregular, regular or srgb. Throws SceneError for
/// unknown types and invalid parameters.
Rgb spectrum_plugin_colour(const SceneObject& spectrum, SpectrumRole role);

}  // namespace etendue
