#pragma once

#include <cmath>
#include <numbers>

#include "emitter/emitter.h"
#include "image/image_io.h"
#include "math/transform.h"
#include "math/warp.h"

namespace etendue {

/// An emitter at a point, with the same intensity in all directions unless derived.
class PointEmitter : public Emitter {
public:
    PointEmitter(Vec3 p, Rgb intensity) : Emitter(Extent::Point), p_(p), intensity_(intensity) {}

    EmissionSample sample_emission(FinePoint, Vec2 u_d) const override {
        const Vec3 d = sample_direction({}, u_d);
        return {p_, d, d, intensity(d), 1, pdf_direction(d), {}, 0};
    }

    bool sample_direct(Vec3 from, FinePoint, DirectSample& out) const override {
        const Vec3 v = p_ - from;
        const float dist2 = length2(v);
        if (!(dist2 > 0)) return false;
        const float dist = std::sqrt(dist2);
        const Vec3 wi = v * (1 / dist);
        const Rgb I = intensity(-wi);
        if (I.is_zero()) return false;
        out = {p_, -wi, wi, dist, I, 1, 1, pdf_direction(-wi), {}, 0};
        return true;
    }

    Emission eval_emission(Vec3, Vec2, uint32_t, Vec3 w) const override {
        return {intensity(w), pdf_direction(w)};
    }
    Vec3 sample_direction(Vec3, Vec2 u) const override { return sample_uniform_sphere(u); }
    float max_pdf_d() const override { return kUniformSpherePdf; }
    double power() const override { return 4 * std::numbers::pi * luminance(intensity_); }

protected:
    virtual Rgb intensity(Vec3) const { return intensity_; }
    virtual float pdf_direction(Vec3) const { return kUniformSpherePdf; }

    Vec3 p_;
    Rgb intensity_;
};

/// Share of a spot light's intensity by direction, a function of the angle to its axis.
class Beam {
public:
    /// Intensity between cut-off and beam: linear in the angle (Mitsuba); or of x, the cosine's way from the one to the
    /// other, x²(3 − 2x) (pbrt-v4), x⁴ (pbrt-v3) or x² (glTF).
    enum class Falloff { Angle, Smooth, Quartic, Quadratic };

    Beam(float cutoff_degrees, float beam_degrees, Falloff falloff)
        : falloff_(falloff), cutoff_(cutoff_degrees * kPi / 180), beam_(beam_degrees * kPi / 180),
          versine_of_cutoff_(2 * sqr(std::sin(cutoff_ / 2))),
          versine_of_beam_(2 * sqr(std::sin(beam_ / 2))) {}

    /// At an angle with the versine 1 - cos θ.
    float share(float versine) const;
    /// The same on the plane at the distance 1 along the axis, at the squared distance `r2` from it.
    float share_on_plane(float r2) const {
        const float secant = std::sqrt(1 + r2);
        return share(r2 / (secant * (1 + secant)));
    }
    /// Integral of share() over all directions.
    double integral() const;
    float versine_of_cutoff() const { return versine_of_cutoff_; }
    float tan_cutoff() const { return std::tan(cutoff_); }

private:
    Falloff falloff_;
    float cutoff_, beam_, versine_of_cutoff_, versine_of_beam_;
};

/// The beam of a `spot`.
Beam read_beam(const Params& params);

/// The emitter that `make` makes of an image, of the power that parameter "power" asks for, if any.
template <class Make>
std::unique_ptr<Emitter> scaled_to_power(const Params& params, RgbImage image, const Make& make) {
    std::unique_ptr<Emitter> emitter = make(image);
    if (!params.has("power")) return emitter;
    const double wanted = double(params.number("power", 0, 0)), power = emitter->power();
    if (!(power > 0)) params.fail("power", "a black image cannot be scaled to a power");
    for (Rgb& c : image.pixels) c *= float(wanted / power);
    return make(std::move(image));
}
/// A parameter that maps the directions of an image or a sky without distortion: rotation, mirror, uniform scale and
/// translation.
Transform similarity(const Params& params, const char* name);

/// The image of a `projection` in W/sr, with its half extents on the plane at the distance 1.
struct ProjectionLight {
    float fov;
    RgbImage image{};
    double half_width = 0, half_height = 0;
};
ProjectionLight read_projection(const Params& params);
/// The emitter `goniometric`.
std::unique_ptr<Emitter> read_goniometric(const Params& params);

EmitterEntry point_entry();
EmitterEntry spot_entry();
EmitterEntry goniometric_entry();
EmitterEntry projection_entry();
EmitterEntry projector_entry();

}  // namespace etendue
