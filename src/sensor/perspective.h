#pragma once

#include "sensor/sensor.h"

namespace etendue {

struct PerspectiveCamera {
    FilmGeometry film;
    float half_width = 1, half_height = 1;  ///< Of the image on the plane z = 1 of camera space.
    Vec2 offset;                            ///< Of the principal point, in widths and heights.
    float lens_radius = 0;                  ///< World units; 0: pinhole.
    float focus_distance = 1;               ///< World units, along +z.
};

/// `to_world` must be rigid.
std::unique_ptr<Sensor> make_perspective(const PerspectiveCamera& camera, const Transform& to_world,
                                         float filter_radius);

SensorEntry perspective_entry();
SensorEntry thinlens_entry();

}  // namespace etendue
