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
// Mitsuba 3.9.1, scalar_rgb, `sunsky` without its sun.
TEST(Sky, HasMitsubasRadiance) {
    const struct {
        float turbidity, albedo, sun, elevation, azimuth;
        Rgb radiance;
    } cases[] = {{3, 0.3f, 40, 40, 30, {0.08122347f, 0.1109589f, 0.1611196f}},
                 {3, 0.3f, 40, 90, 0, {0.02117196f, 0.03803002f, 0.07708794f}},
                 {2.5f, 0, 10, 20, 180, {0.04531296f, 0.06627584f, 0.08253819f}},
                 {6, 0.8f, 70, 5, 90, {0.2419752f, 0.2991554f, 0.3682576f}},
                 {1, 0.3f, 0.5f, 1, 45, {0.05708832f, 0.03207782f, 0.009067428f}},
                 {10, 1, 89, 60, 10, {0.28474f, 0.3091227f, 0.3246918f}}};
    for (const auto& c : cases)
        expect_near_relative(SkyModel(direction(c.sun), c.turbidity, Rgb(c.albedo))
                                 .radiance(direction(c.elevation, c.azimuth)),
                             c.radiance, 2e-4f);
}

TEST(Sky, IsFiniteForAllParameters) {
    for (float turbidity = 1; turbidity <= 10; turbidity += 0.5f)
        for (float sun = 0; sun <= 90; sun += 10) {
            const SkyModel sky(direction(sun), turbidity, Rgb(0, 0.5f, 1));
            for (float e = 0; e <= 90; e += 6)
                for (float a = 0; a < 360; a += 30) {
                    const Rgb c = sky.radiance(direction(e, a));
                    ASSERT_TRUE(is_finite(c));
                    ASSERT_GE(std::min({c.r, c.g, c.b}), 0);
                    ASSERT_LT(c.max(), 10);
                }
        }
}

TEST(Sky, IsSymmetricAboutTheSunsPlane) {
    const SkyModel sky(direction(25), 3, Rgb(0.3f));
    expect_near_relative(sky.radiance(direction(50, 70)), sky.radiance(direction(50, -70)), 1e-5f);
}

TEST(Sky, EndsAtTheHorizonAndWithTheDay) {
    const SkyModel sky(direction(40), 3, Rgb(0.3f));
    EXPECT_TRUE(sky.radiance(direction(-0.1f)).is_zero());
    EXPECT_TRUE(sky.radiance({0, -1, 0}).is_zero());
    EXPECT_FALSE(sky.radiance(direction(0)).is_zero());
    EXPECT_TRUE(SkyModel(direction(-1), 3, Rgb(0.3f)).radiance(direction(30)).is_zero());
}

// Mitsuba 3.9.1, scalar_spectral, `sunsky` without its sky, `complex_sun`; 1 nm steps, with its colour matching functions:
// the middle of the disc, and 0.2° above it. (Its RGB variants have a sun that is 5 to 8 % brighter.)
TEST(Sun, HasMitsubasRadiance) {
    const struct {
        float turbidity, elevation;
        Rgb middle, above;
    } cases[] = {
        {3, 40, {24158.4f, 19913.8f, 15026.6f}, {20299.4f, 16146.1f, 11504.5f}},
        {2.5f, 10, {17437.1f, 10810.3f, 4163.7f}, {14738.0f, 8885.74f, 3264.08f}},
        {6, 70, {23379.7f, 19829.9f, 16316.5f}, {19641.5f, 16069.5f, 12477.2f}},
        {10, 85, {17102.0f, 14115.5f, 11935.5f}, {14361.8f, 11437.8f, 9123.2f}},
    };
    const double psi = std::asin(0.2 / (kSunAperture / 2));
    for (const auto& c : cases) {
        const SunModel sun(c.turbidity);
        const double elevation = double(c.elevation) * M_PI / 180;
        expect_near_relative(sun.radiance(elevation, 1), c.middle, 5e-4f);
        expect_near_relative(sun.radiance(elevation + 0.2 * M_PI / 180, std::cos(psi)), c.above,
                             5e-3f);
    }
}

// The same without `complex_sun`, which Mitsuba takes from a table of elevations.
TEST(Sun, HasMitsubasMeanRadiance) {
    const struct {
        float turbidity, elevation;
        Rgb radiance;
    } cases[] = {{3, 40, {20020.0f, 15912.7f, 11362.1f}},
                 {2.5f, 10, {14323.6f, 8567.84f, 3127.31f}},
                 {6, 70, {19379.8f, 15850.4f, 12342.9f}},
                 {10, 85, {14172.0f, 11283.6f, 9027.15f}}};
    for (const auto& c : cases)
        expect_near_relative(SunModel(c.turbidity).mean_radiance(double(c.elevation) * M_PI / 180),
                             c.radiance, 0.012f);
}

// The sun overhead in clear air gives about 100,000 lux.
TEST(Sun, OverheadIlluminanceIsThatOfDaylight) {
    const double solid_angle = 2 * M_PI * (1 - std::cos(kSunAperture / 2 * M_PI / 180));
    const double lux =
        double(luminance(SunModel(2).mean_radiance(M_PI / 2))) * kLuminanceOfUnitY * solid_angle;
    EXPECT_GT(lux, 80e3);
    EXPECT_LT(lux, 135e3);
}

TEST(Sun, IsDimmerAndRedderWhenLowOrInHaze) {
    const auto sun = [](double elevation, float turbidity) {
        return SunModel(turbidity).mean_radiance(elevation * M_PI / 180);
    };
    EXPECT_LT(luminance(sun(10, 3)), 0.6f * luminance(sun(60, 3)));
    EXPECT_LT(luminance(sun(40, 8)), luminance(sun(40, 2)));
    EXPECT_GT(sun(10, 3).r / sun(10, 3).b, 2 * sun(60, 3).r / sun(60, 3).b);
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
