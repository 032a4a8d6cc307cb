#pragma once
// Coefficients of the sky and sun model of Hosek & Wilkie, see sky_model.cpp. The last index varies fastest.

namespace etendue::hosek_wilkie {

/// By turbidity (1 to 10), albedo (0 and 1), elevation of the sun (control points), channel (R, G, B): A to I.
extern const float kSkyShape[10 * 2 * 6 * 3 * 9];
/// The same for the factor of the radiance.
extern const float kSkyMean[10 * 2 * 6 * 3];
/// By turbidity, elevation (pieces), wavelength (320 to 720 nm): a cubic's coefficients, from the constant one up.
extern const float kSun[10 * 45 * 11 * 4];
/// By wavelength: the coefficients of a polynomial in cos ψ.
extern const float kLimbDarkening[11 * 6];

}  // namespace etendue::hosek_wilkie
