// Daylight: `sky`, `sun`, and both as `sunsky`, with the model of sky_model.h. The sky is tabulated as an environment
// image; the sun is an emitter of its own, a disc of directions.

#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "emitter/environment.h"
#include "emitter/point.h"
#include "emitter/sky_model.h"
#include "math/frame.h"

namespace etendue {
namespace {

/// A disc of directions, sampled uniformly. Its extent is stored as sin² and 1 − cos, since the cosine of such a small
/// angle has too few digits.
class SunEmitter final : public InfiniteEmitter {
public:
    /// With `limb` the disc is darker toward its rim and toward the horizon; without it, it has the same radiance
    /// everywhere. `radiance` is the mean.
    SunEmitter(Vec3 toward, Vec3 up, double angular_radius, Rgb radiance,
               std::optional<SunModel> limb, Rgb scale)
        : frame_(Frame::from_normal(toward)), up_(up), sin2_(sqr(std::sin(angular_radius))),
          one_minus_cos_(2 * sqr(std::sin(angular_radius / 2))),
          pdf_(float(1 / (2 * M_PI * one_minus_cos_))), radiance_(radiance), limb_(std::move(limb)),
          scale_(scale) {}

    double power() const override {
        return M_PI * sqr(double(scene_radius())) * double(luminance(radiance_)) / double(pdf_);
    }

private:
    Sample sample_arrival(FinePoint u) const override {
        const double h = one_minus_cos_ * u.x, sine = std::sqrt(h * (2 - h)), phi = 2 * M_PI * u.y;
        const Vec3 d = frame_.to_world(
            {float(sine * std::cos(phi)), float(sine * std::sin(phi)), float(1 - h)});
        return {d, seen(d), pdf_};
    }
    Rgb radiance(Vec3 d) const override { return is_inside(d) ? seen(d) : Rgb(); }
    float pdf_direction(Vec3 d) const override { return is_inside(d) ? pdf_ : 0.0f; }

    double sin2_to_axis(Vec3 d) const { return double(length2(cross(d, frame_.n))); }
    bool is_inside(Vec3 d) const { return dot(d, frame_.n) > 0 && sin2_to_axis(d) <= sin2_; }

    Rgb seen(Vec3 d) const {
        if (!limb_) return radiance_;
        const double elevation = std::asin(std::clamp(double(dot(d, up_)), -1.0, 1.0));
        const double cos_psi = std::sqrt(std::max(0.0, 1 - sin2_to_axis(d) / sin2_));
        return limb_->radiance(elevation, cos_psi) * scale_;
    }

    Frame frame_;
    Vec3 up_;
    double sin2_, one_minus_cos_;
    float pdf_;
    Rgb radiance_;  ///< Mean over the disc.
    std::optional<SunModel> limb_;
    Rgb scale_;
};

/// From the axes of sun_direction() and environments (x east, y up, z south) to those of Mitsuba 3 (x south, y west, z
/// up).
const Transform kFromYUp(Transform::Matrix{
    {{0, 0, 1, 0}, {-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}}});

std::vector<ParamInfo> params() {
    return {
        {"turbidity", ParamKind::Float, "3", "Haze: 1 (clear) to 10."},
        {"sun_direction", ParamKind::Vector, "",
         "Direction toward the sun in world space, instead of time and place. If it is below the "
         "horizon, the emitter is black."},
        {"year", ParamKind::Int, "2010", "Year, for the position of the sun."},
        {"month", ParamKind::Int, "7", "Month, 1 to 12."},
        {"day", ParamKind::Int, "10", "Day, 1 to 31."},
        {"hour", ParamKind::Float, "15", "Local time without daylight saving."},
        {"minute", ParamKind::Float, "0", "Minute, 0 to 60."},
        {"second", ParamKind::Float, "0", "Second, 0 to 60."},
        {"latitude", ParamKind::Float, "35.6894", "Latitude in degrees; north is positive."},
        {"longitude", ParamKind::Float, "139.6917", "Longitude in degrees; east is positive."},
        {"timezone", ParamKind::Float, "9", "Time zone in hours ahead of universal time."},
        {"scale", ParamKind::Float, "1", "Factor on all radiance."},
        {"sky_scale", ParamKind::Float, "1", "Factor on the sky's radiance."},
        {"sun_scale", ParamKind::Float, "1", "Factor on the sun's radiance."},
        {"sun_aperture", ParamKind::Float, "0.5358",
         "Angle in degrees that the sun's disc subtends; it does not change the sun's power."},
        {"sun_radius_scale", ParamKind::Float, "1",
         "The same angle as a factor on 0.5358 degrees."},
        {"resolution", ParamKind::Int, "512", "Number of rows of the table that stores the sky."},
        {"albedo", ParamKind::Rgb, "0.3",
         "Albedo of the ground, 0 to 1; light reflected from the ground brightens the sky."},
        {"complex_sun", ParamKind::Bool, "false",
         "Whether the sun is darker toward its rim; otherwise its disc has the mean radiance "
         "everywhere."},
        {"to_world", ParamKind::Transform, "identity",
         "Rotation; up is +z, south +x, west +y. In files of Mitsuba 0.6 up is +y, east +x, south "
         "+z."},
    };
}

/// Parameters shared by sky and sun.
struct Daylight {
    Transform to_world;  ///< From axes with y up.
    Vec3 sun;            ///< Unit vector toward the sun, with y up.
    float turbidity;

    bool is_day() const { return sun.y >= 0; }
};

Daylight read_daylight(const Params& p) {
    Daylight out;
    out.to_world = similarity(p, "to_world") * kFromYUp;
    out.turbidity = p.number("turbidity", 3, 1, 10);
    if (p.has("sun_direction")) {
        const Vec3 d = out.to_world.inverse().vector(p.vector("sun_direction", {}));
        if (!(length2(d) > 0))
            p.fail("sun_direction", "parameter \"sun_direction\" must not be zero");
        out.sun = normalize(d);
        return out;
    }
    SunTime t;
    t.year = int(p.integer("year", t.year, 1901, 2199));
    t.month = int(p.integer("month", t.month, 1, 12));
    t.day = int(p.integer("day", t.day, 1, 31));
    t.hour = p.number("hour", float(t.hour), 0, 24);
    t.minute = p.number("minute", 0, 0, 60);
    t.second = p.number("second", 0, 0, 60);
    t.latitude = p.number("latitude", float(t.latitude), -90, 90);
    t.longitude = p.number("longitude", float(t.longitude), -180, 180);
    t.timezone = p.number("timezone", float(t.timezone), -14, 14);
    out.sun = sun_direction(t);
    return out;
}

Rgb read_albedo(const Params& p) {
    const Rgb albedo = p.rgb("albedo", Rgb(0.3f));
    if (albedo.max() > 1)
        p.fail("albedo", fmt::format("parameter \"albedo\" is ({}, {}, {}), but its components "
                                     "must be at most 1",
                                     albedo.r, albedo.g, albedo.b));
    return albedo;
}

std::unique_ptr<Emitter> make_sky(const Params& p, const Daylight& day) {
    const int height = int(p.integer("resolution", 512, 16, 8192)), width = 2 * height;
    const float scale = p.number("scale", 1, 0) * p.number("sky_scale", 1, 0);
    const SkyModel model(day.sun, day.turbidity, read_albedo(p));
    std::vector<Rgb> pixels(size_t(width) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float theta = kPi * (float(y) + 0.5f) / float(height),
                        phi = 2 * kPi * (float(x) + 0.5f) / float(width);
            const Vec3 d{std::sin(phi) * std::sin(theta), std::cos(theta),
                         -std::cos(phi) * std::sin(theta)};
            pixels[size_t(y) * width + x] = model.radiance(d) * scale;
        }
    return make_environment(width, height, std::move(pixels), day.to_world);
}

/// Aperture of the sun relative to the real one.
double read_aperture(const Params& p) {
    if (p.has("sun_aperture") && p.has("sun_radius_scale"))
        p.fail("sun_radius_scale",
               "give either \"sun_aperture\" or \"sun_radius_scale\", not both");
    return p.has("sun_aperture") ? double(p.number("sun_aperture", 0, 1e-3f, 179)) / kSunAperture
                                 : double(p.number("sun_radius_scale", 1, 0.01f, 100));
}

std::unique_ptr<Emitter> make_sun(const Params& p, const Daylight& day) {
    constexpr double kDegree = M_PI / 180;
    const double natural = kSunAperture / 2 * kDegree, radius = natural * read_aperture(p);
    // Keeps the power independent of the aperture.
    const double share = sqr(std::sin(natural / 2) / std::sin(radius / 2));
    const Rgb scale(p.number("scale", 1, 0) * p.number("sun_scale", 1, 0) * float(share));
    const Vec3 toward = normalize(day.to_world.vector(day.sun)),
               up = normalize(day.to_world.vector({0, 1, 0}));
    const SunModel model(day.turbidity);
    const Rgb mean = model.mean_radiance(std::asin(std::clamp(double(day.sun.y), -1.0, 1.0)));
    return std::make_unique<SunEmitter>(
        toward, up, radius, mean * scale,
        p.flag("complex_sun", false) ? std::optional(model) : std::nullopt, scale);
}

}  // namespace

EmitterEntry sky_entry() {
    return {{"emitter", "sky", "Clear sky without the sun [Hosek & Wilkie 2012].", params()},
            [](const Params& p, EmitterContext&) {
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_sky(p, read_daylight(p)));
                return made;
            }};
}

EmitterEntry sun_entry() {
    return {{"emitter", "sun", "The sun's disc through a clear atmosphere [Hosek & Wilkie 2013].",
             params()},
            [](const Params& p, EmitterContext&) {
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_sun(p, read_daylight(p)));
                return made;
            }};
}

EmitterEntry sunsky_entry() {
    return {{"emitter", "sunsky", "sun and sky together.", params()},
            [](const Params& p, EmitterContext&) {
                const Daylight day = read_daylight(p);
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_sky(p, day));
                if (day.is_day()) made.push_back(make_sun(p, day));
                return made;
            }};
}

}  // namespace etendue
