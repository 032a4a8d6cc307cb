#include "emitter/sky_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "expect_rgb.h"

namespace etendue {
namespace {

constexpr float kDegree = kPi / 180;
/// cd/m² of a Y of 1.
constexpr double kLuminanceOfUnitY = 683.002 * 106.857;

/// Unit vector at this elevation, toward east for azimuth 0.
Vec3 direction(float elevation, float azimuth = 0) {
    const float c = std::cos(elevation * kDegree);
    return {c * std::cos(azimuth * kDegree), std::sin(elevation * kDegree),
            c * std::sin(azimuth * kDegree)};
}
double elevation(Vec3 d) {
    return std::asin(d.y) / kDegree;
}
/// From north over east.
double azimuth(Vec3 d) {
    const double degrees = std::atan2(d.x, -d.z) / kDegree;
    return degrees < 0 ? degrees + 360 : degrees;
}
double luminance_at(const SkyModel& sky, Vec3 d) {
    return luminance(sky.sky_radiance(d));
}

// [Preetham et al. 1999, A.2], written out for one setting: T = 4, θ_s = 50°.
TEST(Sky, ZenithHasThePapersLuminanceAndChromaticity) {
    const double T = 4, theta = 50 * M_PI / 180, t2 = theta * theta, t3 = t2 * theta;
    const double chi = (4.0 / 9 - T / 120) * (M_PI - 2 * theta);
    const double kcd = (4.0453 * T - 4.9710) * std::tan(chi) - 0.2155 * T + 2.4192;
    const double x = T * T * (0.00166 * t3 - 0.00375 * t2 + 0.00209 * theta) +
                     T * (-0.02903 * t3 + 0.06377 * t2 - 0.03202 * theta + 0.00394) +
                     (0.11693 * t3 - 0.21196 * t2 + 0.06052 * theta + 0.25886);
    const double y = T * T * (0.00275 * t3 - 0.00610 * t2 + 0.00317 * theta) +
                     T * (-0.04214 * t3 + 0.08970 * t2 - 0.04153 * theta + 0.00516) +
                     (0.15346 * t3 - 0.26756 * t2 + 0.06670 * theta + 0.26688);
    const Rgb c = SkyModel(direction(40), 4).sky_radiance({0, 1, 0});
    EXPECT_NEAR(luminance(c) * kLuminanceOfUnitY / 1000, kcd, 1e-3 * kcd);
    // sRGB to XYZ [IEC 61966-2-1].
    const double X = 0.412453 * c.r + 0.357580 * c.g + 0.180423 * c.b;
    const double Z = 0.019334 * c.r + 0.119193 * c.g + 0.950227 * c.b;
    const double sum = X + luminance(c) + Z;
    EXPECT_NEAR(X / sum, x, 1e-4);
    EXPECT_NEAR(luminance(c) / sum, y, 1e-4);
}

TEST(Sky, IsFiniteAndLitForAllParameters) {
    for (float turbidity = 1; turbidity <= 10; turbidity += 0.5f)
        for (float sun = 0; sun <= 90; sun += 10) {
            const SkyModel sky(direction(sun), turbidity);
            for (float e = 0; e <= 90; e += 6)
                for (float a = 0; a < 360; a += 30) {
                    const Rgb c = sky.sky_radiance(direction(e, a));
                    ASSERT_TRUE(is_finite(c));
                    ASSERT_GT(luminance(c), 0) << turbidity << " " << sun << " " << e << " " << a;
                    ASSERT_LT(luminance(c), 10);
                }
        }
}

TEST(Sky, IsBrighterTowardTheSun) {
    for (const float turbidity : {2.0f, 3.0f, 6.0f}) {
        const SkyModel sky(direction(40), turbidity);
        double before = luminance_at(sky, direction(40));
        for (const float azimuth : {10.0f, 20.0f, 40.0f, 60.0f}) {
            const double now = luminance_at(sky, direction(40, azimuth));
            EXPECT_LT(now, before);
            before = now;
        }
        EXPECT_GT(luminance_at(sky, direction(40)), 3 * luminance_at(sky, direction(40, 180)));
    }
}

TEST(Sky, IsSymmetricAboutTheSunsPlane) {
    const SkyModel sky(direction(25), 3);
    expect_near_relative(sky.sky_radiance(direction(50, 70)), sky.sky_radiance(direction(50, -70)),
                         1e-5f);
}

TEST(Sky, IsBlueAwayFromTheSunAndPalerWithTurbidity) {
    const auto blueness = [](float turbidity) {
        const Rgb c = SkyModel(direction(60), turbidity).sky_radiance(direction(50, 180));
        return c.b / c.r;
    };
    EXPECT_GT(blueness(2), 2.5f);
    EXPECT_GT(blueness(2), blueness(4));
    EXPECT_GT(blueness(4), blueness(8));
}

TEST(Sky, EndsAtTheHorizon) {
    const SkyModel sky(direction(40), 3);
    EXPECT_TRUE(sky.sky_radiance(direction(-0.1f)).is_zero());
    EXPECT_TRUE(sky.sky_radiance({0, -1, 0}).is_zero());
    EXPECT_FALSE(sky.sky_radiance(direction(0)).is_zero());
}

// The sun overhead in clear air gives about 100,000 lux [Preetham et al. 1999 leave about 20 % to
// the sky].
TEST(Sun, OverheadIlluminanceIsThatOfDaylight) {
    const SkyModel sky(direction(90), 2);
    const double solid_angle = 2 * M_PI * (1 - std::cos(double(kSunAngularRadius)));
    const double lux = luminance(sky.sun_radiance()) * kLuminanceOfUnitY * solid_angle;
    EXPECT_GT(lux, 80e3);
    EXPECT_LT(lux, 125e3);
}

TEST(Sun, IsDimmerAndRedderWhenLowOrInHaze) {
    const auto sun = [](float elevation, float turbidity) {
        return SkyModel(direction(elevation), turbidity).sun_radiance();
    };
    EXPECT_LT(luminance(sun(10, 3)), 0.5f * luminance(sun(60, 3)));
    EXPECT_LT(luminance(sun(40, 8)), luminance(sun(40, 2)));
    EXPECT_GT(sun(10, 3).r / sun(10, 3).b, 2 * sun(60, 3).r / sun(60, 3).b);
    EXPECT_FALSE(sun(0, 3).is_zero());
    EXPECT_TRUE(sun(-1, 3).is_zero());
}

TEST(SunDirection, AgreesWithMitsuba) {
    // Mitsuba 3.9 at its default time and place gives (0.0513854, 0.691748, 0.720308) as (south,
    // west, up).
    const Vec3 d = sun_direction({});
    EXPECT_NEAR(d.x, -0.691748f, 2e-5f);
    EXPECT_NEAR(d.y, 0.720308f, 2e-5f);
    EXPECT_NEAR(d.z, 0.0513854f, 2e-5f);
}

TEST(SunDirection, EquinoxNoonAtTheEquatorIsOverhead) {
    // The equation of time is 7.5 minutes on 20 March.
    const Vec3 d = sun_direction({.year = 2000,
                                  .month = 3,
                                  .day = 20,
                                  .hour = 12,
                                  .minute = 7.5,
                                  .latitude = 0,
                                  .longitude = 0,
                                  .timezone = 0});
    EXPECT_GT(elevation(d), 89.8);
}

TEST(SunDirection, SolsticeNoonAtTheTropicIsOverhead) {
    const Vec3 d = sun_direction({.year = 2010,
                                  .month = 6,
                                  .day = 21,
                                  .hour = 12,
                                  .minute = 1.8,
                                  .latitude = 23.44,
                                  .longitude = 0,
                                  .timezone = 0});
    EXPECT_GT(elevation(d), 89.8);
}

TEST(SunDirection, RisesInTheEastAndStandsInTheSouth) {
    SunTime london{.year = 2010,
                   .month = 12,
                   .day = 21,
                   .hour = 11,
                   .minute = 58,
                   .latitude = 51.5,
                   .longitude = 0,
                   .timezone = 0};
    EXPECT_NEAR(elevation(sun_direction(london)), 90 - 51.5 - 23.44, 0.1);
    EXPECT_NEAR(azimuth(sun_direction(london)), 180, 0.5);
    london.month = 9, london.day = 23, london.hour = 6, london.minute = 0;
    EXPECT_NEAR(azimuth(sun_direction(london)), 90, 3);
    EXPECT_NEAR(elevation(sun_direction(london)), 0, 2);
    london.hour = 18;
    EXPECT_NEAR(azimuth(sun_direction(london)), 270, 3);
}

TEST(SunDirection, SouthOfTheTropicItStandsInTheNorth) {
    const Vec3 d = sun_direction({.year = 2010,
                                  .month = 6,
                                  .day = 21,
                                  .hour = 12,
                                  .latitude = -33.9,
                                  .longitude = 151.2,
                                  .timezone = 10});
    EXPECT_NEAR(elevation(d), 90 - 33.9 - 23.44, 0.2);
    EXPECT_LT(d.z, 0);
}

TEST(SunDirection, MidnightSunAndThePoles) {
    for (const double hour : {0.0, 6.0, 12.0, 18.0}) {
        const Vec3 d = sun_direction({.year = 2010,
                                      .month = 6,
                                      .day = 21,
                                      .hour = hour,
                                      .latitude = 90,
                                      .longitude = 0,
                                      .timezone = 0});
        EXPECT_NEAR(elevation(d), 23.44, 0.05);
        EXPECT_NEAR(length(d), 1, 1e-6f);
    }
}

TEST(SunDirection, TimezoneAndLongitudeMoveTogether) {
    const SunTime here{.hour = 9, .longitude = 0, .timezone = 0};
    const SunTime there{.hour = 17, .longitude = 0, .timezone = 8};
    EXPECT_NEAR(length(sun_direction(here) - sun_direction(there)), 0, 1e-6f);
}

}  // namespace
}  // namespace etendue
