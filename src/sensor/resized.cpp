// A pixel of the new film has the area of several pixels of the old one, so that the densities per pixel, and W_e, are
// smaller by this factor.

#include "sensor/resized.h"

namespace etendue {
namespace {

class ResizedSensor final : public Sensor {
public:
    ResizedSensor(const Sensor& sensor, const FilmGeometry& film, int width, int height,
                  Vec2 margin)
        : origin_{float(film.crop_x), float(film.crop_y)},
          pixel_{float(film.crop_width) / float(width), float(film.crop_height) / float(height)},
          scale_(1 / (pixel_.x * pixel_.y)), sensor_(sensor.with_margin(in_whole(margin))) {}

    SensorRay sample_ray(Vec2 film, Vec2 u_lens) const override {
        return resized(sensor_->sample_ray(whole(film), u_lens));
    }
    SensorRay ray_from(Vec3 lens, Vec2 film) const override {
        return resized(sensor_->ray_from(lens, whole(film)));
    }
    std::optional<SensorSample> sample_connection(Vec3 from, bool from_infinity,
                                                  Vec2 u_lens) const override {
        return resized(sensor_->sample_connection(from, from_infinity, u_lens));
    }
    std::optional<SensorSample> connection_to(Vec3 lens, Vec3 from,
                                              bool from_infinity) const override {
        return resized(sensor_->connection_to(lens, from, from_infinity));
    }
    std::optional<SensorSample> hit_lens(Vec3 o, Vec3 d, float tmax) const override {
        return resized(sensor_->hit_lens(o, d, tmax));
    }

    bool is_orthographic() const override { return sensor_->is_orthographic(); }
    bool has_finite_lens() const override { return sensor_->has_finite_lens(); }
    Bounds3 lens_bounds() const override { return sensor_->lens_bounds(); }
    float pdf_direction(Vec3 p, Vec3 d) const override {
        return sensor_->pdf_direction(p, d) * scale_;
    }
    std::shared_ptr<const Sensor> with_margin(Vec2 margin) const override {
        auto copy = std::make_shared<ResizedSensor>(*this);
        copy->sensor_ = sensor_->with_margin(in_whole(margin));
        return copy;
    }

private:
    Vec2 in_whole(Vec2 margin) const { return {margin.x * pixel_.x, margin.y * pixel_.y}; }
    Vec2 whole(Vec2 film) const {
        return {origin_.x + film.x * pixel_.x, origin_.y + film.y * pixel_.y};
    }
    SensorRay resized(SensorRay ray) const {
        ray.pdf_dir *= scale_;
        return ray;
    }
    std::optional<SensorSample> resized(std::optional<SensorSample> sample) const {
        if (!sample) return sample;
        sample->film = {(sample->film.x - origin_.x) / pixel_.x,
                        (sample->film.y - origin_.y) / pixel_.y};
        sample->We_cos *= scale_;
        sample->pdf_dir *= scale_;
        return sample;
    }

    Vec2 origin_, pixel_;  ///< A pixel's size in pixels of the whole film.
    float scale_;
    std::shared_ptr<const Sensor> sensor_;
};

}  // namespace

std::shared_ptr<const Sensor> make_resized(const Sensor& sensor, const FilmGeometry& film,
                                           int width, int height, float margin) {
    return std::make_shared<ResizedSensor>(sensor, film, width, height, Vec2{margin, margin});
}

}  // namespace etendue
