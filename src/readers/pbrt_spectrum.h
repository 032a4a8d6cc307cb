#pragma once
// Spectra of pbrt scenes as linear sRGB.

#include "readers/pbrt_arguments.h"

namespace etendue {

class PbrtScene;

/// Colour of an rgb, xyz, blackbody or spectrum parameter. pbrt-v4 gives every light the luminance 1 before its scale, and
/// reflectances are seen under D65; pbrt-v3 weights all with the CIE curves alone.
Rgb pbrt_colour(const PbrtValue& value, PbrtSpectrum kind, const PbrtScene& scene);
/// Index of refraction at the sodium line of one of pbrt-v4's glasses ("glass-BK7"), nothing for other names.
std::optional<float> pbrt_glass(std::string_view name);
/// One number that stands for a spectrum: its value near the middle of the visible range.
float pbrt_number(const PbrtValue& value, const PbrtScene& scene);

}  // namespace etendue
