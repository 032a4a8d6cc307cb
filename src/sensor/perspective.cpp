// Perspective cameras: pinhole (`perspective`) and with a finite round lens (`thinlens`).
//
// In camera space the view is along +z, with x to the left and y up, as in Mitsuba. A film point is mapped to the plane
// z = 1, where `pixel_area_` is the area of a pixel. The density of a direction per pixel is
//     pdf_σ = 1 / (pixel_area · cos³θ)
// for the pinhole and for every point of the lens, since the plane in focus is a scaled copy of z = 1.

#include "sensor/perspective.h"

#include <cmath>

#include <fmt/format.h>

#include "description/view.h"
#include "math/warp.h"

namespace etendue {
namespace {

class PerspectiveSensor final : public Sensor {
public:
    PerspectiveSensor(const PerspectiveCamera& camera, const Transform& to_world,
                      float filter_radius)
        : camera_(camera), origin_(to_world.point({0, 0, 0})),
          left_(normalize(to_world.vector({1, 0, 0}))), up_(normalize(to_world.vector({0, 1, 0}))),
          forward_(normalize(to_world.vector({0, 0, 1}))) {
        pixel_area_ = (2 * camera.half_width / float(camera.film.width)) *
                      (2 * camera.half_height / float(camera.film.height));
        set_margin(Vec2{1, 1} * (filter_radius - 0.5f));
        pdf_pos_ = has_finite_lens() ? 1 / (kPi * sqr(camera.lens_radius)) : 1.0f;
    }

    SensorRay sample_ray(Vec2 film, Vec2 u_lens) const override {
        return has_finite_lens() ? ray_through(sample_lens(u_lens), film) : ray_through({}, film);
    }
    SensorRay ray_from(Vec3 lens, Vec2 film) const override {
        if (!has_finite_lens()) return ray_through({}, film);
        const Vec3 local = to_local(lens - origin_);
        return ray_through({local.x, local.y}, film);
    }

    std::optional<SensorSample> sample_connection(Vec3 from, bool from_infinity,
                                                  Vec2 u_lens) const override {
        return measure(has_finite_lens() ? lens_point(sample_lens(u_lens)) : origin_, from,
                       from_infinity);
    }
    std::optional<SensorSample> connection_to(Vec3 lens, Vec3 from,
                                              bool from_infinity) const override {
        return measure(has_finite_lens() ? lens : origin_, from, from_infinity);
    }

    std::optional<SensorSample> hit_lens(Vec3 o, Vec3 d, float tmax) const override {
        const Vec3 lo = to_local(o - origin_), ld = to_local(d);
        if (!(ld.z < 0)) return {};  // from behind
        const float t = -lo.z / ld.z;
        if (!(t > 0 && t < tmax)) return {};
        const Vec3 lens = lo + ld * t;
        // Not even where a ray meets a pinhole exactly.
        if (!(sqr(lens.x) + sqr(lens.y) < sqr(camera_.lens_radius))) return {};
        return measure(o + d * t, -d);
    }

    bool has_finite_lens() const override { return camera_.lens_radius > 0; }
    Bounds3 lens_bounds() const override {
        Bounds3 b;
        if (has_finite_lens())
            for (const float side : {-1.0f, 1.0f}) {
                b.extend(origin_ + (left_ + up_) * (side * camera_.lens_radius));
                b.extend(origin_ + (left_ - up_) * (side * camera_.lens_radius));
            }
        return b;
    }
    float pdf_direction(Vec3, Vec3 d) const override { return pdf_of_cosine(dot(forward_, d)); }

    std::shared_ptr<const Sensor> with_margin(Vec2 margin) const override {
        auto copy = std::make_shared<PerspectiveSensor>(*this);
        copy->set_margin(margin);
        return copy;
    }

private:
    Vec3 to_world(Vec3 v) const { return left_ * v.x + up_ * v.y + forward_ * v.z; }
    Vec3 to_local(Vec3 v) const { return {dot(v, left_), dot(v, up_), dot(v, forward_)}; }
    Vec2 sample_lens(Vec2 u) const { return sample_uniform_disk(u) * camera_.lens_radius; }

    float pdf_of_cosine(float c) const { return c > 0 ? 1 / (pixel_area_ * c * c * c) : 0.0f; }

    Vec2 film_to_plane(Vec2 film) const {
        return {camera_.half_width *
                    (1 - 2 * (film.x / float(camera_.film.width) + camera_.offset.x)),
                camera_.half_height *
                    (1 - 2 * (film.y / float(camera_.film.height) + camera_.offset.y))};
    }

    Vec3 lens_point(Vec2 on_lens) const { return to_world({on_lens.x, on_lens.y, 0}) + origin_; }
    SensorRay ray_through(Vec2 on_lens, Vec2 film) const {
        const Vec2 on_plane = film_to_plane(film);
        Vec3 target{on_plane.x, on_plane.y, 1}, lens = origin_;
        if (has_finite_lens()) {
            lens = lens_point(on_lens);
            target = target * camera_.focus_distance - Vec3{on_lens.x, on_lens.y, 0};
        }
        const Vec3 d = normalize(target);
        return {lens, forward_, to_world(d), pdf_pos_, pdf_of_cosine(d.z)};
    }
    std::optional<SensorSample> measure(Vec3 lens, Vec3 from, bool from_infinity) const {
        return measure(lens, from_infinity ? from : from - lens);
    }
    /// The measurement of light that arrives at `lens` along -v; v points from the lens into the scene.
    std::optional<SensorSample> measure(Vec3 lens, Vec3 v) const {
        const float dist2 = length2(v);
        if (!(dist2 > 0)) return {};
        const Vec3 d = v * (1 / std::sqrt(dist2));
        const float cos = dot(forward_, d);
        if (!(cos > 0)) return {};
        const Vec3 local = to_local(v);
        Vec2 plane;
        if (has_finite_lens()) {
            const Vec3 origin = to_local(lens - origin_);
            const float k = camera_.focus_distance / local.z;
            plane = {(origin.x + local.x * k) / camera_.focus_distance,
                     (origin.y + local.y * k) / camera_.focus_distance};
        } else {
            plane = {local.x / local.z, local.y / local.z};
        }
        const Vec2 film{((1 - plane.x / camera_.half_width) * 0.5f - camera_.offset.x) *
                            float(camera_.film.width),
                        ((1 - plane.y / camera_.half_height) * 0.5f - camera_.offset.y) *
                            float(camera_.film.height)};
        if (!(film.x >= lo_.x && film.x < hi_.x && film.y >= lo_.y && film.y < hi_.y)) return {};
        const float pdf = pdf_of_cosine(cos);
        return SensorSample{lens, forward_, film, pdf_pos_ * pdf, pdf_pos_, pdf};
    }

    void set_margin(Vec2 margin) {
        const FilmGeometry& f = camera_.film;
        lo_ = Vec2{float(f.crop_x), float(f.crop_y)} - margin;
        hi_ = Vec2{float(f.crop_x + f.crop_width), float(f.crop_y + f.crop_height)} + margin;
    }

    PerspectiveCamera camera_;
    Vec3 origin_, left_, up_, forward_;  ///< Origin and axes of camera space, in world space.
    Vec2 lo_, hi_;                       ///< Film points that are measured.
    float pixel_area_, pdf_pos_;
};

/// The camera's transform without its scale: lens radius and focus distance are in world units.
Transform rigid(const Params& params) {
    const Transform t = params.transform("to_world");
    Transform::Matrix m = t.matrix();
    if (m[3][0] != 0 || m[3][1] != 0 || m[3][2] != 0 || m[3][3] != 1)
        params.fail("to_world", "\"to_world\" of a sensor must be an affine transform");
    for (int c = 0; c < 3; ++c) {
        const double len = std::sqrt(m[0][c] * m[0][c] + m[1][c] * m[1][c] + m[2][c] * m[2][c]);
        for (int r = 0; r < 3; ++r) m[r][c] /= len;
    }
    // The axes are then those of a rotation, perhaps with a mirror.
    constexpr double kTolerance = 1e-3;
    for (int c = 0; c < 3; ++c) {
        const int d = (c + 1) % 3;
        if (!(std::fabs(m[0][c] * m[0][d] + m[1][c] * m[1][d] + m[2][c] * m[2][d]) < kTolerance))
            params.fail(
                "to_world",
                fmt::format("\"to_world\" of sensor \"{}\" shears: it may rotate, mirror and "
                            "move; a scale along the axes of the camera has no effect",
                            params.object().type));
    }
    return Transform(m);
}

/// Sets the half extents of the image on the plane z = 1.
void set_field_of_view(const Params& params, PerspectiveCamera& camera) {
    const double aspect = params.has("aspect") ? double(params.number("aspect", 1, 1e-6f, 1e6f))
                                               : double(camera.film.width) / camera.film.height;
    const double half_width = view_half_width(params, aspect);
    camera.half_width = float(half_width);
    camera.half_height = float(half_width / aspect);
}

std::unique_ptr<Sensor> make(const Params& params, const SensorContext& context, bool lens) {
    PerspectiveCamera camera;
    camera.film = context.film;
    set_field_of_view(params, camera);
    camera.offset = {params.number("principal_point_offset_x", 0, -10, 10),
                     params.number("principal_point_offset_y", 0, -10, 10)};
    if (lens) {
        camera.lens_radius = params.number("aperture_radius", 0, 0);
        if (!params.has("aperture_radius"))
            params.fail("sensor \"thinlens\" needs the parameter \"aperture_radius\"");
        camera.focus_distance = params.number("focus_distance", 0, 1e-6f);
        if (!params.has("focus_distance"))
            params.fail("sensor \"thinlens\" needs the parameter \"focus_distance\"");
    }
    return make_perspective(camera, rigid(params), context.filter_radius);
}

std::vector<ParamInfo> shared_params(const std::vector<ParamInfo>& more) {
    return concat(
        {{{"to_world", ParamKind::Transform, "identity",
           "Camera-to-world transform; the camera looks along +z, with +x to the left and +y up."}},
         view_params("that of the film"),
         {{"principal_point_offset_x", ParamKind::Float, "0",
           "Shift of the image centre, as a fraction of the width."},
          {"principal_point_offset_y", ParamKind::Float, "0",
           "Shift of the image centre, as a fraction of the height."},
          {"near_clip", ParamKind::Float, "", "Accepted; rays are not clipped."},
          {"far_clip", ParamKind::Float, "", "Accepted; rays are not clipped."},
          {"shutter_open", ParamKind::Float, "0", "Accepted; nothing moves."},
          {"shutter_close", ParamKind::Float, "0", "Accepted; nothing moves."}},
         more});
}

}  // namespace

std::unique_ptr<Sensor> make_perspective(const PerspectiveCamera& camera, const Transform& to_world,
                                         float filter_radius) {
    return std::make_unique<PerspectiveSensor>(camera, to_world, filter_radius);
}

SensorEntry perspective_entry() {
    return {{"sensor", "perspective", "Pinhole camera.", shared_params({})},
            [](const Params& p, const SensorContext& c) { return make(p, c, false); }};
}

SensorEntry thinlens_entry() {
    return {{"sensor", "thinlens", "Perspective camera with a finite round lens.",
             shared_params(
                 {{"aperture_radius", ParamKind::Float, "", "Radius of the lens in world units."},
                  {"focus_distance", ParamKind::Float, "",
                   "Distance of the plane in focus along +z, in world units."}})},
            [](const Params& p, const SensorContext& c) { return make(p, c, true); }};
}

}  // namespace etendue
