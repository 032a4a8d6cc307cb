#pragma once
// Clear daylight sky and sun [Preetham, Shirley & Smits 1999], and where the sun stands
// [Blanco-Muriel et al. 2001].
//
// Units are W m⁻² sr⁻¹ nm⁻¹, averaged over the wavelengths as spectrum_to_rgb() does; a luminance of
// 1 kcd/m² is a Y of 0.0137. These are Mitsuba's units too, but its sky is that of Hosek & Wilkie
// [2012, 2013], which also has a ground albedo. Beside Mitsuba 3.9 this sky is up to 2.5 times
// brighter at the zenith and down to 0.6 times at the horizon (turbidity 2 to 4), and the high sun
// differs by 10 %. The sun is that of Mitsuba 0.6.

#include "color/rgb.h"
#include "math/vec.h"

namespace etendue {

/// Radius of the sun's disc in radians (0.2665°).
inline constexpr float kSunAngularRadius = 0.2665f * kPi / 180;

class SkyModel {
public:
    /// `sun` is the unit vector toward the sun, y being up; a sun below the horizon counts as one
    /// on it. Turbidity lies in [1, 10]. Below 2 the fit of the sky turns negative, so that the sky
    /// stays at 2 there.
    SkyModel(Vec3 sun, float turbidity);

    /// Radiance of the sky without the sun in direction `d` (unit); zero below the horizon.
    Rgb sky_radiance(Vec3 d) const;
    /// Radiance of the sun's disc of the radius kSunAngularRadius; zero below the horizon.
    Rgb sun_radiance() const { return sun_radiance_; }
    Vec3 sun_direction() const { return sun_; }

private:
    /// F(θ, γ) = (1 + A exp(B / cos θ)) (1 + C exp(D γ) + E cos² γ) [Perez et al. 1993].
    struct Perez {
        double A, B, C, D, E;
        double operator()(double cos_theta, double gamma, double cos_gamma) const;
    };
    /// Zenith value and distribution of the luminance Y or of a chromaticity x, y.
    struct Component {
        Perez perez;
        double at_zenith;  ///< Divided by F(0, θ_s).
    };

    Vec3 sun_;
    Component Y_, x_, y_;
    Rgb sun_radiance_;
};

/// Civil time and place of an observer.
struct SunTime {
    int year = 2010, month = 7, day = 10;
    double hour = 15, minute = 0, second = 0;         ///< Local time without daylight saving.
    double latitude = 35.6894, longitude = 139.6917;  ///< Degrees, north and east positive.
    double timezone = 9;                              ///< Hours ahead of universal time.
};

/// Unit vector toward the sun: y is up, x east and -z north (as in Mitsuba 0.6).
Vec3 sun_direction(const SunTime& time);

}  // namespace etendue
