#pragma once
// Spectra to linear sRGB: CIE 1931 standard observer, sRGB primaries, no chromatic adaptation.

#include <span>
#include <vector>

#include "color/rgb.h"

namespace etendue {

/// CIE XYZ to linear sRGB (Rec. 709 primaries, D65 white).
Rgb xyz_to_rgb(double X, double Y, double Z);

/// What a spectrum is seen by. Emission stands for itself, so the flat spectrum is the reddish
/// (1.205, 0.948, 0.909); a reflectance or another ratio is weighted by daylight, so the flat one
/// is (1, 1, 1).
enum class Illuminant { EqualEnergy, D65 };

/// Colour of a spectrum given at strictly increasing wavelengths in nm, linear between them and
/// zero outside. A flat spectrum of 1 has luminance 1 under either illuminant; components outside
/// the gamut become zero.
Rgb spectrum_to_rgb(std::span<const double> wavelengths_nm, std::span<const double> values,
                    Illuminant illuminant = Illuminant::EqualEnergy);

/// By how much each sample of a spectrum adds to its colour: spectrum_to_rgb() without the clipping.
std::vector<Rgb> spectrum_weights(std::span<const double> wavelengths_nm,
                                  Illuminant illuminant = Illuminant::EqualEnergy);

/// Radiance of a black body at the given temperature, in W m⁻² sr⁻¹ nm⁻¹ (Planck's law).
Rgb blackbody_rgb(double kelvin);

}  // namespace etendue
