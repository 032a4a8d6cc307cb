// Orthographic camera: every eye path starts in the same direction. Like y_0 of a directional emitter, z_0 is at
// infinity: its density is 1 (discrete), and z_1 has density |cos θ| / A_pixel per pixel.

#include "sensor/orthographic.h"

namespace etendue {
namespace {

class OrthographicSensor final : public Sensor {
public:
    OrthographicSensor(const Transform& to_world, const SensorContext& context)
        : to_world_(to_world), to_local_(to_world.inverse()), film_(context.film) {
        aspect_ = float(film_.width) / float(film_.height);
        forward_ = normalize(to_world.vector({0, 0, 1}));
        const Vec3 x = to_world.vector({2.0f / float(film_.width), 0, 0});
        const Vec3 y = to_world.vector({0, 2.0f / (aspect_ * float(film_.height)), 0});
        pixel_area_ = abs_dot(cross(x, y), forward_);
        set_margin(Vec2{1, 1} * (context.filter_radius - 0.5f));
    }

    SensorRay sample_ray(Vec2 film, Vec2) const override {
        const Vec3 local{1 - 2 * film.x / float(film_.width),
                         (1 - 2 * film.y / float(film_.height)) / aspect_, 0};
        return {to_world_.point(local), forward_, forward_, 1, 1 / pixel_area_};
    }

    std::optional<SensorSample> sample_connection(Vec3 from, bool, Vec2) const override {
        const Vec3 local = to_local_.point(from);
        if (!(local.z > 0)) return {};
        const Vec2 film{(1 - local.x) * 0.5f * float(film_.width),
                        (1 - local.y * aspect_) * 0.5f * float(film_.height)};
        if (!(film.x >= lo_.x && film.x < hi_.x && film.y >= lo_.y && film.y < hi_.y)) return {};
        return SensorSample{to_world_.point({local.x, local.y, 0}),
                            forward_,
                            film,
                            1 / pixel_area_,
                            1,
                            1 / pixel_area_};
    }

    bool is_orthographic() const override { return true; }
    float pdf_direction(Vec3, Vec3) const override { return 1 / pixel_area_; }
    std::shared_ptr<const Sensor> with_margin(Vec2 margin) const override {
        auto copy = std::make_shared<OrthographicSensor>(*this);
        copy->set_margin(margin);
        return copy;
    }

private:
    void set_margin(Vec2 margin) {
        lo_ = Vec2{float(film_.crop_x), float(film_.crop_y)} - margin;
        hi_ =
            Vec2{float(film_.crop_x + film_.crop_width), float(film_.crop_y + film_.crop_height)} +
            margin;
    }

    Transform to_world_, to_local_;
    FilmGeometry film_;
    Vec3 forward_;
    Vec2 lo_, hi_;  ///< Film points that are measured.
    float aspect_, pixel_area_;
};

}  // namespace

SensorEntry orthographic_entry() {
    return {{"sensor",
             "orthographic",
             "Parallel projection; the image spans [-1, 1] in x of camera space.",
             {{"to_world", ParamKind::Transform, "identity",
               "Camera-to-world transform; its scale sets the size of the view."},
              {"near_clip", ParamKind::Float, "", "Accepted; rays are not clipped."},
              {"far_clip", ParamKind::Float, "", "Accepted; rays are not clipped."}}},
            [](const Params& p, const SensorContext& c) -> std::unique_ptr<Sensor> {
                return std::make_unique<OrthographicSensor>(p.transform("to_world"), c);
            }};
}

}  // namespace etendue
