#include "emitter/sky_model.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numbers>

#include "color/spectrum.h"

namespace etendue {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Luminance in cd/m² of a spectrum whose Y (as spectrum_to_rgb() normalises it) is 1: the luminous
/// efficacy of 683 lm/W times ∫ ȳ(λ) dλ in nm.
constexpr double kLuminanceOfUnitY = 683.002 * 106.857;

double zenith_luminance_kcd(double T, double theta_s) {
    const double chi = (4.0 / 9 - T / 120) * (std::numbers::pi - 2 * theta_s);
    return (4.0453 * T - 4.9710) * std::tan(chi) - 0.2155 * T + 2.4192;
}

/// Coefficients of T² θ³ ... T⁰ θ⁰ of the chromaticity at the zenith [Preetham et al. 1999, A.2].
using ZenithFit = double[3][4];
constexpr ZenithFit kZenithX = {{0.00166, -0.00375, 0.00209, 0},
                                {-0.02903, 0.06377, -0.03202, 0.00394},
                                {0.11693, -0.21196, 0.06052, 0.25886}};
constexpr ZenithFit kZenithY = {{0.00275, -0.00610, 0.00317, 0},
                                {-0.04214, 0.08970, -0.04153, 0.00516},
                                {0.15346, -0.26756, 0.06670, 0.26688}};

double zenith_chromaticity(const ZenithFit& fit, double T, double theta_s) {
    double value = 0;
    for (const auto& row : fit) {
        double in_theta = 0;
        for (const double c : row) in_theta = in_theta * theta_s + c;
        value = value * T + in_theta;
    }
    return value;
}

/// The sun outside the atmosphere (W m⁻² sr⁻¹ nm⁻¹) and the absorption of ozone (cm⁻¹), water
/// vapour (cm⁻¹) and mixed gases (km⁻¹), from 380 nm in steps of 10 nm [Preetham et al. 1999, table
/// 2].
struct SunRow {
    double radiance, ozone, vapour, gas;
};
constexpr double kSunFirstNm = 380, kSunStepNm = 10;
constexpr std::array<SunRow, 38> kSun = {{
    {16559.0, 0, 0, 0},          {16233.7, 0, 0, 0},         {21127.5, 0, 0, 0},
    {25888.2, 0, 0, 0},          {25829.1, 0, 0, 0},         {24232.3, 0, 0, 0},
    {26760.5, 0, 0, 0},          {29658.3, 0.003, 0, 0},     {30545.4, 0.006, 0, 0},
    {30057.5, 0.009, 0, 0},      {30663.7, 0.014, 0, 0},     {28830.4, 0.021, 0, 0},
    {28712.1, 0.030, 0, 0},      {27825.0, 0.040, 0, 0},     {27100.6, 0.048, 0, 0},
    {27233.6, 0.063, 0, 0},      {26361.3, 0.075, 0, 0},     {25503.8, 0.085, 0, 0},
    {25060.2, 0.103, 0, 0},      {25311.6, 0.120, 0, 0},     {25355.9, 0.120, 0, 0},
    {25134.2, 0.115, 0, 0},      {24631.5, 0.125, 0, 0},     {24173.2, 0.120, 0, 0},
    {23685.3, 0.105, 0, 0},      {23212.1, 0.090, 0, 0},     {22827.7, 0.079, 0, 0},
    {22339.8, 0.067, 0, 0},      {21970.2, 0.057, 0, 0},     {21526.7, 0.048, 0, 0},
    {21097.9, 0.036, 0, 0},      {20728.3, 0.028, 0.016, 0}, {20240.4, 0.023, 0.024, 0},
    {19870.8, 0.018, 0.0125, 0}, {19427.2, 0.014, 1.0, 0},   {19072.4, 0.011, 0.87, 0},
    {18628.9, 0.010, 0.061, 0},  {18259.2, 0.009, 0.001, 0},
}};

/// The sun's radiance after its way through the atmosphere [Preetham et al. 1999, A.1].
Rgb attenuated_sun(double T, double theta_s) {
    constexpr double kOzoneCm = 0.35, kVapourCm = 2, kAlpha = 1.3;
    const double beta = 0.04608 * T - 0.04586;
    // Relative optical mass [Kasten 1965].
    const double m = 1 / (std::cos(theta_s) + 0.15 * std::pow(93.885 - theta_s / kDegree, -1.253));
    std::array<double, kSun.size()> nm, radiance;
    for (size_t i = 0; i < kSun.size(); ++i) {
        nm[i] = kSunFirstNm + kSunStepNm * double(i);
        const double um = nm[i] / 1000;
        const auto& [sun, ozone, vapour, gas] = kSun[i];
        const double rayleigh = 0.008735 * std::pow(um, -4.08) * m;
        const double aerosol = beta * std::pow(um, -kAlpha) * m;
        const double in_gas = 1.41 * gas * m / std::pow(1 + 118.93 * gas * m, 0.45);
        const double in_vapour =
            0.2385 * vapour * kVapourCm * m / std::pow(1 + 20.07 * vapour * kVapourCm * m, 0.45);
        radiance[i] =
            sun * std::exp(-(rayleigh + aerosol + ozone * kOzoneCm * m + in_gas + in_vapour));
    }
    return spectrum_to_rgb(nm, radiance);
}

}  // namespace

double SkyModel::Perez::operator()(double cos_theta, double gamma, double cos_gamma) const {
    constexpr double kMinCosine = 1e-3;
    return (1 + A * std::exp(B / std::max(cos_theta, kMinCosine))) *
           (1 + C * std::exp(D * gamma) + E * cos_gamma * cos_gamma);
}

SkyModel::SkyModel(Vec3 sun, float turbidity) : sun_(sun) {
    constexpr double kMinSkyTurbidity = 2;
    const double cos_s = std::clamp(double(sun.y), 0.0, 1.0), theta_s = std::acos(cos_s);
    const double T = std::max(double(turbidity), kMinSkyTurbidity);
    const auto component = [&](const Perez& perez, double at_zenith) {
        return Component{perez, at_zenith / perez(1, theta_s, cos_s)};
    };
    // [Preetham et al. 1999, A.2]
    Y_ = component({0.1787 * T - 1.4630, -0.3554 * T + 0.4275, -0.0227 * T + 5.3251,
                    0.1206 * T - 2.5771, -0.0670 * T + 0.3703},
                   zenith_luminance_kcd(T, theta_s) * 1000 / kLuminanceOfUnitY);
    x_ = component({-0.0193 * T - 0.2592, -0.0665 * T + 0.0008, -0.0004 * T + 0.2125,
                    -0.0641 * T - 0.8989, -0.0033 * T + 0.0452},
                   zenith_chromaticity(kZenithX, T, theta_s));
    y_ = component({-0.0167 * T - 0.2608, -0.0950 * T + 0.0092, -0.0079 * T + 0.2102,
                    -0.0441 * T - 1.6537, -0.0109 * T + 0.0529},
                   zenith_chromaticity(kZenithY, T, theta_s));
    if (sun.y >= 0) sun_radiance_ = attenuated_sun(turbidity, theta_s);
}

Rgb SkyModel::sky_radiance(Vec3 d) const {
    if (!(d.y >= 0)) return {};
    const double cos_gamma = std::clamp(double(dot(d, sun_)), -1.0, 1.0);
    const double gamma = std::acos(cos_gamma);
    const auto eval = [&](const Component& c) {
        return c.at_zenith * c.perez(d.y, gamma, cos_gamma);
    };
    const double Y = eval(Y_), x = eval(x_), y = eval(y_);
    const Rgb c = xyz_to_rgb(Y * x / y, Y, Y * (1 - x - y) / y);
    return {std::max(c.r, 0.0f), std::max(c.g, 0.0f), std::max(c.b, 0.0f)};
}

Vec3 sun_direction(const SunTime& time) {
    using namespace std::chrono;
    const double hours = time.hour + time.minute / 60 + time.second / 3600 - time.timezone;
    const sys_days midnight =
        year(time.year) / month(unsigned(time.month)) / day(unsigned(time.day));
    const sys_days j2000 = year(2000) / 1 / 1;
    // Days since noon of 1 January 2000, universal time.
    const double n = double((midnight - j2000).count()) - 0.5 + hours / 24;

    // Ecliptic coordinates [Blanco-Muriel et al. 2001].
    const double omega = 2.1429 - 0.0010394594 * n;
    const double mean_longitude = 4.8950630 + 0.017202791698 * n;
    const double anomaly = 6.2400600 + 0.0172019699 * n;
    const double longitude = mean_longitude + 0.03341607 * std::sin(anomaly) +
                             0.00034894 * std::sin(2 * anomaly) - 0.0001134 -
                             0.0000203 * std::sin(omega);
    const double obliquity = 0.4090928 - 6.2140e-9 * n + 0.0000396 * std::cos(omega);
    // Celestial coordinates.
    const double right_ascension =
        std::atan2(std::cos(obliquity) * std::sin(longitude), std::cos(longitude));
    const double declination = std::asin(std::sin(obliquity) * std::sin(longitude));
    // Hour angle.
    const double greenwich_sidereal_hours = 6.6974243242 + 0.0657098283 * n + hours;
    const double hour_angle =
        (greenwich_sidereal_hours * 15 + time.longitude) * kDegree - right_ascension;

    const double latitude = time.latitude * kDegree;
    const double east = -std::cos(declination) * std::sin(hour_angle);
    const double north = std::sin(declination) * std::cos(latitude) -
                         std::cos(declination) * std::sin(latitude) * std::cos(hour_angle);
    const double up = std::cos(latitude) * std::cos(declination) * std::cos(hour_angle) +
                      std::sin(declination) * std::sin(latitude);
    // Parallax: seen from the surface, the sun stands lower by R/AU sin θ.
    constexpr double kEarthRadiusPerAu = 6371.01 / 149597890;
    const double theta = std::acos(std::clamp(up, -1.0, 1.0));
    const double lowered = theta + kEarthRadiusPerAu * std::sin(theta);
    const double horizontal = std::hypot(east, north);
    const double scale = horizontal > 0 ? std::sin(lowered) / horizontal : 0;
    return {float(east * scale), float(std::cos(lowered)), float(-north * scale)};
}

}  // namespace etendue
