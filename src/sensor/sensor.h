#pragma once
// Sensors: the far end of every path. A sensor's densities are per pixel (film area in pixels), so that one eye path a
// pixel counts 1 in a weight, and W_e is normalised so that one eye path's throughput at z_1 is 1.

#include <memory>
#include <optional>

#include "color/rgb.h"
#include "description/params.h"
#include "film/film.h"
#include "math/bounds.h"
#include "math/transform.h"
#include "math/vec.h"

namespace etendue {

/// z_0 and the direction to z_1, drawn for a film point.
struct SensorRay {
    Vec3 p;         ///< z_0
    Vec3 ng;        ///< Normal of the lens, toward the scene.
    Vec3 d;         ///< Toward z_1, unit length.
    float pdf_pos;  ///< Density of z_0 on the lens (area); 1 for a pinhole; 1 for orthographic.
    /// Density of d per pixel: solid angle at z_0. Orthographic: density of the ray in the plane normal to d.
    float pdf_dir;
};

/// z_0 as seen from a point of the scene.
struct SensorSample {
    Vec3 p;  ///< z_0; for orthographic sensors the direction toward the sensor.
    Vec3 ng;
    Vec2 film;      ///< Film point at which the measurement lands.
    float We_cos;   ///< W_e·|cos θ at z_0| (orthographic: W_e), over nothing: divide by pdf_pos.
    float pdf_pos;  ///< Density of z_0.
    float pdf_dir;  ///< As SensorRay::pdf_dir, of the direction to the scene point.
};

class Sensor {
public:
    virtual ~Sensor() = default;

    /// Ray through a film point; `u_lens` picks the point on a finite lens.
    virtual SensorRay sample_ray(Vec2 film, Vec2 u_lens) const = 0;
    /// A connection from `from` (a point, or a direction to it) to the lens; nothing outside the film (grown by the
    /// filter's radius).
    virtual std::optional<SensorSample> sample_connection(Vec3 from, bool from_infinity,
                                                          Vec2 u_lens) const = 0;
    /// Where a light ray o + t·d, t in (0, tmax), crosses a finite lens from its front, and what it measures there.
    virtual std::optional<SensorSample> hit_lens(Vec3 o, Vec3 d, float tmax) const;

    /// True where z_0 is at infinity in a fixed direction.
    virtual bool is_orthographic() const { return false; }
    /// True where light paths can hit the lens.
    virtual bool has_finite_lens() const { return false; }
    /// Of a finite lens, empty for others: light paths from infinity must be able to reach it.
    virtual Bounds3 lens_bounds() const { return {}; }
    /// Direction and density of a film point, as sample_ray() would give it for `d` from `p`.
    virtual float pdf_direction(Vec3 p, Vec3 d) const = 0;
};

/// What a sensor's maker needs besides its own parameters.
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
