#pragma once
// Spectra of Mitsuba scenes as linear sRGB.

#include "readers/mitsuba_values.h"

namespace etendue {

/// What a spectrum stands for, which decides the white it is seen under and its range.
enum class SpectrumRole {
    Emission,     ///< Radiance and the like: its own colour.
    Reflectance,  ///< A ratio in [0, 1], seen under D65.
    Ratio,  ///< A ratio without an upper bound (index of refraction, extinction), seen under D65.
};

Rgb spectrum_colour(const SpectrumSamples& samples, SpectrumRole role);

/// The colour of <spectrum type="...">: blackbody, uniform, d65, irregular, regular, srgb. Checks
/// its parameters.
Rgb spectrum_plugin_colour(const SceneObject& spectrum, SpectrumRole role);

}  // namespace etendue
