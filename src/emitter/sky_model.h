#pragma once
// Clear daylight: radiance of the sky [Hosek & Wilkie 2012] and of the sun [Hosek & Wilkie 2013], and position of the
// sun [Blanco-Muriel et al. 2001]. Mitsuba 3 has the same models.
//
// Units are W m⁻² sr⁻¹ nm⁻¹, averaged over the wavelengths as spectrum_to_rgb() does; a luminance of 1 kcd/m² is a Y of
// 0.0137.

#include <array>
#include <vector>

#include "color/rgb.h"
#include "math/vec.h"

namespace etendue {

/// Angular diameter of the sun, in degrees.
inline constexpr double kSunAperture = 0.5358;

/// Radiance of the sky without the sun.
class SkyModel {
public:
    /// `sun` is the unit vector toward the sun, with y up; the sky is black if the sun is below the horizon. The
    /// turbidity is in [1, 10], the albedo of the ground in [0, 1].
    SkyModel(Vec3 sun, float turbidity, Rgb albedo);

    /// Radiance from the unit vector `d`, with y up; black below the horizon.
    Rgb radiance(Vec3 d) const;

private:
    struct Channel {
        std::array<double, 9> shape;
        double mean;

        double radiance(double cos_theta, double gamma, double cos_gamma) const;
    };
    Vec3 sun_;
    std::array<Channel, 3> channels_;
};

/// Radiance of a sun of angular diameter kSunAperture.
class SunModel {
public:
    explicit SunModel(float turbidity);

    /// Radiance at an elevation in radians. ψ is the angle between the line of sight and the normal of the sun's
    /// surface: `cos_psi` is 1 at the centre of the disc and 0 at its rim. Zero below the horizon.
    Rgb radiance(double elevation, double cos_psi) const;
    /// Mean over the disc of a sun at this elevation; zero below the horizon.
    Rgb mean_radiance(double elevation) const;

private:
    double turbidity_;
    std::vector<Rgb> weights_;  ///< Of the model's wavelengths, see spectrum_weights().
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
