// Daylight: `sky`, `sun` and both as `sunsky`, from the model of sky_model.h. The sky is tabulated as an environment
// image; the sun is a uniform disc of directions, sampled by itself.

#include <cmath>

#include "emitter/environment.h"
#include "emitter/sky_model.h"
#include "math/frame.h"
#include "math/warp.h"

namespace etendue {
namespace {

/// Uniform radiance within a cone of directions.
class SunEmitter final : public InfiniteEmitter {
public:
    SunEmitter(Vec3 toward, float angular_radius, Rgb radiance)
        : frame_(Frame::from_normal(toward)), cos_max_(std::cos(angular_radius)),
          radiance_(radiance) {}

    double power() const override {
        return double(kPi) * sqr(double(scene_radius())) * luminance(radiance_) /
               pdf_uniform_cone(cos_max_);
    }

private:
    Sample sample_arrival(FinePoint u) const override {
        const Vec3 local = sample_uniform_cone(to_float(u), cos_max_);
        return {frame_.to_world(local), radiance_, pdf_uniform_cone(cos_max_)};
    }
    Rgb radiance(Vec3 d) const override { return is_inside(d) ? radiance_ : Rgb(); }
    float pdf_direction(Vec3 d) const override {
        return is_inside(d) ? pdf_uniform_cone(cos_max_) : 0.0f;
    }
    /// By the distance to the axis: the cosine alone has too few digits for half a degree.
    bool is_inside(Vec3 d) const {
        return dot(d, frame_.n) > 0 && length2(cross(d, frame_.n)) <= 1 - sqr(cos_max_);
    }

    Frame frame_;
    float cos_max_;
    Rgb radiance_;
};

std::vector<ParamInfo> params() {
    return {
        {"turbidity", ParamKind::Float, "3", "Haze: 1 (clear, taken as 2 for the sky) to 10."},
        {"sun_direction", ParamKind::Vector, "",
         "Toward the sun, before to_world; instead of time and place."},
        {"year", ParamKind::Int, "2010", "Date of the sun's position."},
        {"month", ParamKind::Int, "7", "1 to 12."},
        {"day", ParamKind::Int, "10", "1 to 31."},
        {"hour", ParamKind::Float, "15", "Local time without daylight saving."},
        {"minute", ParamKind::Float, "0", "0 to 60."},
        {"second", ParamKind::Float, "0", "0 to 60."},
        {"latitude", ParamKind::Float, "35.6894", "Degrees, north positive."},
        {"longitude", ParamKind::Float, "139.6917", "Degrees, east positive."},
        {"timezone", ParamKind::Float, "9", "Hours ahead of universal time."},
        {"scale", ParamKind::Float, "1", "Factor of all radiance."},
        {"sky_scale", ParamKind::Float, "1", "Factor of the sky's radiance."},
        {"sun_scale", ParamKind::Float, "1", "Factor of the sun's radiance."},
        {"sun_radius_scale", ParamKind::Float, "1",
         "Factor of the sun's angular radius; its power stays."},
        {"resolution", ParamKind::Int, "512", "Rows of the table of the sky."},
        {"albedo", ParamKind::Rgb, "", "Accepted; the model has no ground."},
        {"to_world", ParamKind::Transform, "identity", "Rotation; up is +y, east +x, north -z."},
    };
}

SkyModel read_model(const Params& p) {
    const float turbidity = p.number("turbidity", 3, 1, 10);
    if (p.has("sun_direction")) {
        const Vec3 d = p.vector("sun_direction", {});
        if (!(length2(d) > 0)) p.fail("sun_direction", "the direction must not be zero");
        return SkyModel(normalize(d), turbidity);
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
    return SkyModel(sun_direction(t), turbidity);
}

std::unique_ptr<Emitter> make_sky(const Params& p, const SkyModel& model) {
    const int height = int(p.integer("resolution", 512, 16, 8192)), width = 2 * height;
    const float scale = p.number("scale", 1, 0) * p.number("sky_scale", 1, 0);
    std::vector<Rgb> pixels(size_t(width) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float theta = kPi * (float(y) + 0.5f) / float(height),
                        phi = 2 * kPi * (float(x) + 0.5f) / float(width);
            const Vec3 d{std::sin(phi) * std::sin(theta), std::cos(theta),
                         -std::cos(phi) * std::sin(theta)};
            pixels[size_t(y) * width + x] = model.sky_radiance(d) * scale;
        }
    return make_environment(width, height, std::move(pixels), p.transform("to_world"));
}

std::unique_ptr<Emitter> make_sun(const Params& p, const SkyModel& model) {
    const float radius_scale = p.number("sun_radius_scale", 1, 0.01f, 100);
    const float scale = p.number("scale", 1, 0) * p.number("sun_scale", 1, 0) / sqr(radius_scale);
    const Vec3 toward = normalize(p.transform("to_world").vector(model.sun_direction()));
    return std::make_unique<SunEmitter>(toward, kSunAngularRadius * radius_scale,
                                        model.sun_radiance() * scale);
}

}  // namespace

EmitterEntry sky_entry() {
    return {{"emitter", "sky", "Clear sky without the sun [Preetham et al. 1999].", params()},
            [](const Params& p, EmitterContext&) {
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_sky(p, read_model(p)));
                return made;
            }};
}

EmitterEntry sun_entry() {
    return {{"emitter", "sun", "The sun's disc through a clear atmosphere [Preetham et al. 1999].",
             params()},
            [](const Params& p, EmitterContext&) {
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_sun(p, read_model(p)));
                return made;
            }};
}

EmitterEntry sunsky_entry() {
    return {{"emitter", "sunsky", "sun and sky together.", params()},
            [](const Params& p, EmitterContext&) {
                const SkyModel model = read_model(p);
                std::vector<std::unique_ptr<Emitter>> made;
                made.push_back(make_sky(p, model));
                if (!model.sun_radiance().is_zero()) made.push_back(make_sun(p, model));
                return made;
            }};
}

}  // namespace etendue
