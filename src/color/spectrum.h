#pragma once
// Spectra to linear sRGB: CIE 1931 standard observer, sRGB primaries, no chromatic adaptation.

#include <span>
#include <vector>

#include "color/rgb.h"

namespace etendue {

/// CIE XYZ to linear sRGB (Rec. 709 primaries, D65 white).
Rgb xyz_to_rgb(double X, double Y, double Z);

/// Illuminant that weights a spectrum. Emission is not weighted (EqualEnergy), so a flat spectrum has the reddish
/// colour (1.205, 0.948, 0.909). Reflectances and other ratios are seen under D65, where a flat spectrum is (1, 1, 1).
enum class Illuminant { EqualEnergy, D65 };

/// Colour of a spectrum given at strictly increasing wavelengths in nm, linear between them and
/// zero outside. A flat spectrum of 1 has luminance 1 under either illuminant; components outside
/// the gamut become zero.
Rgb spectrum_to_rgb(std::span<const double> wavelengths_nm, std::span<const double> values,
                    Illuminant illuminant = Illuminant::EqualEnergy);

/// Coefficients of spectrum_to_rgb() before clipping: the colour is the sum of each value times its weight.
std::vector<Rgb> spectrum_weights(std::span<const double> wavelengths_nm,
                                  Illuminant illuminant = Illuminant::EqualEnergy);

/// Radiance of a black body at the given temperature, in W m⁻² sr⁻¹ nm⁻¹ (Planck's law).
Rgb blackbody_rgb(double kelvin);

}  // namespace etendue
