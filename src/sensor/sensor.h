#pragma once
// Sensors: the last vertex of every path. Densities of directions are per pixel (film area in pixels), so that one eye
// path per pixel counts 1 in MIS weights. W_e is normalised so that the throughput of an eye path at z_1 is 1.

#include <memory>
#include <optional>

#include "color/rgb.h"
#include "description/params.h"
#include "film/film.h"
#include "math/bounds.h"
#include "math/transform.h"
#include "math/vec.h"

namespace etendue {

/// z_0 and the direction to z_1, sampled for a film point.
struct SensorRay {
    Vec3 p;         ///< z_0
    Vec3 ng;        ///< Normal of the lens, toward the scene.
    Vec3 d;         ///< Toward z_1, unit length.
    float pdf_pos;  ///< Density of z_0 on the lens (area); 1 for a pinhole; 1 for orthographic.
    /// Density of d per pixel: solid angle at z_0. Orthographic: density of the ray in the plane normal to d.
    float pdf_dir;
};

/// z_0 connected to a point of the scene.
struct SensorSample {
    Vec3 p;  ///< z_0; for orthographic sensors the direction toward the sensor.
    Vec3 ng;
    Vec2 film;      ///< Film point of the measurement, in pixels.
    float We_cos;   ///< W_e·|cos θ at z_0| (orthographic: W_e), not divided by pdf_pos.
    float pdf_pos;  ///< Density of z_0.
    float pdf_dir;  ///< As SensorRay::pdf_dir, of the direction to the scene point.
};

class Sensor {
public:
    virtual ~Sensor() = default;

    /// Ray through a film point, in pixels; `u_lens` chooses the point on a finite lens.
    virtual SensorRay sample_ray(Vec2 film, Vec2 u_lens) const = 0;
    /// The same from a given point of a finite lens, which other sensors ignore.
    virtual SensorRay ray_from(Vec3 /*lens*/, Vec2 film) const { return sample_ray(film, {}); }
    /// Connection from `from`, a point or the direction to one at infinity, to the lens; empty outside the crop,
    /// extended by the filter's radius.
    virtual std::optional<SensorSample> sample_connection(Vec3 from, bool from_infinity,
                                                          Vec2 u_lens) const = 0;
    /// The same to a given point of a finite lens, which other sensors ignore.
    virtual std::optional<SensorSample> connection_to(Vec3 /*lens*/, Vec3 from,
                                                      bool from_infinity) const {
        return sample_connection(from, from_infinity, {});
    }
    /// The measurement of a light ray o + t·d, t in (0, tmax), that crosses a finite lens from its front; empty
    /// otherwise.
    virtual std::optional<SensorSample> hit_lens(Vec3 o, Vec3 d, float tmax) const;

    /// Whether z_0 is at infinity, in a fixed direction.
    virtual bool is_orthographic() const { return false; }
    /// Whether light paths can hit the lens.
    virtual bool has_finite_lens() const { return false; }
    /// Bounds of a finite lens, which light paths from infinity must reach; empty for other sensors.
    virtual Bounds3 lens_bounds() const { return {}; }
    /// SensorRay::pdf_dir of the direction `d` from the lens point `p`.
    virtual float pdf_direction(Vec3 p, Vec3 d) const = 0;
    /// A copy that measures film points up to `margin` pixels beyond the crop, instead of the filter's radius.
    virtual std::shared_ptr<const Sensor> with_margin(Vec2 margin) const = 0;
};

/// Arguments for the construction of sensors besides parameters.
struct SensorContext {
    FilmGeometry film;
    float filter_radius;
    float scene_radius;  ///< Radius of the scene's bounding sphere.
    Vec3 scene_center;
};

struct SensorEntry {
    PluginInfo info;
    std::unique_ptr<Sensor> (*make)(const Params& params, const SensorContext& context);
};
const std::vector<SensorEntry>& sensor_registry();

}  // namespace etendue
