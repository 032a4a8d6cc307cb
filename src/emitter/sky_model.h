#pragma once
// Clear daylight: sky [Hosek & Wilkie 2012], sun [Hosek & Wilkie 2013], and where the sun stands [Blanco-Muriel et al.
// 2001]. Mitsuba 3 has the same models.
//
// Units are W m⁻² sr⁻¹ nm⁻¹, averaged over the wavelengths as spectrum_to_rgb() does; a luminance of 1 kcd/m² is a Y of
// 0.0137.

#include <array>
#include <vector>

#include "color/rgb.h"
#include "math/vec.h"

namespace etendue {

/// Full angle of the sun's disc, degrees.
inline constexpr double kSunAperture = 0.5358;

/// Radiance of the sky without the sun, of the directions above the horizon.
class SkyModel {
public:
    /// `sun` is the unit vector toward the sun, y being up; with the sun below the horizon the sky is black. Turbidity
    /// lies in [1, 10], the albedo of the ground in [0, 1].
    SkyModel(Vec3 sun, float turbidity, Rgb albedo);

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

/// Radiance of a sun with the aperture kSunAperture.
class SunModel {
public:
    explicit SunModel(float turbidity);

    /// Seen at an elevation (radians), where the line of sight makes the angle ψ with the sun's surface normal: 1 in the
    /// middle of the disc, 0 at its rim. Zero below the horizon.
    Rgb radiance(double elevation, double cos_psi) const;
    /// Mean over the disc of a sun at this elevation; zero below the horizon.
    Rgb mean_radiance(double elevation) const;

private:
    double turbidity_;
    std::vector<Rgb> weights_;  ///< Of the wavelengths.
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
