#include "emitter/sky_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "color/spectrum.h"
#include "emitter/hosek_wilkie_data.h"

namespace etendue {
namespace {

constexpr double kPiD = std::numbers::pi, kDegree = kPiD / 180;

/// A position between the turbidities 1, 2, ... 10 of the tables.
struct TurbidityLevel {
    int below;
    double fraction;

    explicit TurbidityLevel(double turbidity) {
        const double at = std::clamp(turbidity, 1.0, 10.0) - 1;
        below = std::min(int(at), 8);
        fraction = at - below;
    }
    /// `value(level)` between the two nearest levels.
    template <class Value>
    double interpolate(const Value& value) const {
        return std::lerp(value(below), value(below + 1), fraction);
    }
};

/// Bézier curve of degree 5 over the sun's elevation, parametrised by its cube root to be finer near the horizon [Hosek
/// & Wilkie 2012, §5.1].
template <class Value>
double at_elevation(double elevation, const Value& control_point) {
    constexpr double kBinomial[] = {1, 5, 10, 10, 5, 1};
    const double x = std::cbrt(elevation / (kPiD / 2));
    double sum = 0;
    for (int i = 0; i < 6; ++i)
        sum += kBinomial[i] * std::pow(x, i) * std::pow(1 - x, 5 - i) * control_point(i);
    return sum;
}

/// An entry of a table of the sky, interpolated over turbidity, albedo and elevation.
double sky_entry(const float* table, int entries, int entry, int channel, double turbidity,
                 double albedo, double elevation) {
    return TurbidityLevel(turbidity).interpolate([&](int level) {
        const auto of_albedo = [&](int a) {
            return at_elevation(elevation, [&](int i) {
                return double(table[(((level * 2 + a) * 6 + i) * 3 + channel) * entries + entry]);
            });
        };
        return std::lerp(of_albedo(0), of_albedo(1), albedo);
    });
}

/// ∫ ȳ(λ) dλ in nm: converts the table of the sky, which has integrals over wavelengths, to means.
constexpr double kIntegralOfY = 106.7502593994140625;

}  // namespace

SkyModel::SkyModel(Vec3 sun, float turbidity, Rgb albedo) : sun_(sun) {
    const double elevation = std::asin(std::clamp(double(sun.y), 0.0, 1.0));
    for (int c = 0; c < 3; ++c) {
        const auto entry = [&](const float* table, int entries, int i) {
            return sky_entry(table, entries, i, c, turbidity, double(albedo[c]), elevation);
        };
        Channel& channel = channels_[size_t(c)];
        for (int i = 0; i < 9; ++i) channel.shape[size_t(i)] = entry(hosek_wilkie::kSkyShape, 9, i);
        channel.mean = sun.y >= 0 ? entry(hosek_wilkie::kSkyMean, 1, 0) / kIntegralOfY : 0;
    }
}

// [Hosek & Wilkie 2012, eq. 8 and 9]
double SkyModel::Channel::radiance(double cos_theta, double gamma, double cos_gamma) const {
    const auto [A, B, C, D, E, F, G, I, H] = shape;
    const double chi = (1 + cos_gamma * cos_gamma) / std::pow(1 + H * H - 2 * H * cos_gamma, 1.5);
    return mean * (1 + A * std::exp(B / (cos_theta + 0.01))) *
           (C + D * std::exp(E * gamma) + F * cos_gamma * cos_gamma + G * chi +
            I * std::sqrt(cos_theta));
}

Rgb SkyModel::radiance(Vec3 d) const {
    if (!(d.y >= 0)) return {};
    const double cos_gamma = std::clamp(double(dot(d, sun_)), -1.0, 1.0);
    const double gamma = std::acos(cos_gamma);
    Rgb out;
    for (int c = 0; c < 3; ++c)
        out[c] = float(std::max(0.0, channels_[size_t(c)].radiance(double(d.y), gamma, cos_gamma)));
    return out;
}

namespace {

constexpr int kWavelengths = 11, kPieces = 45;
constexpr std::array<double, kWavelengths> kNanometres = {320, 360, 400, 440, 480, 520,
                                                          560, 600, 640, 680, 720};

/// Horner's rule, the constant coefficient first.
template <size_t n>
double polynomial(const float* coefficients, double x) {
    double value = 0;
    for (size_t i = n; i-- > 0;) value = value * x + double(coefficients[i]);
    return value;
}

}  // namespace

SunModel::SunModel(float turbidity)
    : turbidity_(double(turbidity)), weights_(spectrum_weights(kNanometres)) {}

// [Hosek & Wilkie 2013, eq. 2 to 4]
Rgb SunModel::radiance(double elevation, double cos_psi) const {
    if (!(elevation >= 0)) return {};
    const TurbidityLevel turbidity(turbidity_);
    const int piece = std::min(int(std::cbrt(elevation / (kPiD / 2)) * kPieces), kPieces - 1);
    const double x = elevation - std::pow(double(piece) / kPieces, 3) * (kPiD / 2);
    Rgb out;
    for (int i = 0; i < kWavelengths; ++i) {
        const double in_the_middle = turbidity.interpolate([&](int level) {
            return polynomial<4>(
                hosek_wilkie::kSun + ((level * kPieces + piece) * kWavelengths + i) * 4, x);
        });
        const double darkened = polynomial<6>(hosek_wilkie::kLimbDarkening + i * 6, cos_psi);
        out += weights_[size_t(i)] * float(in_the_middle * darkened);
    }
    // The colour of a low sun is outside the gamut.
    return {std::max(out.r, 0.0f), std::max(out.g, 0.0f), std::max(out.b, 0.0f)};
}

Rgb SunModel::mean_radiance(double elevation) const {
    // Rings and sectors of equal area; at this size the disc is treated as flat.
    constexpr int kRings = 32, kSectors = 16;
    constexpr double kRadius = kSunAperture / 2 * kDegree;
    if (!(elevation >= 0)) return {};
    Rgb sum;
    for (int i = 0; i < kRings; ++i)
        for (int j = 0; j < kSectors; ++j) {
            const double r2 = (i + 0.5) / kRings, phi = 2 * kPiD * (j + 0.5) / kSectors;
            sum += radiance(elevation + kRadius * std::sqrt(r2) * std::sin(phi), std::sqrt(1 - r2));
        }
    return sum / float(kRings * kSectors);
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
