#pragma once
// A sensor whose film has another resolution.

#include <memory>

#include "sensor/sensor.h"

namespace etendue {

/// `sensor`, of which a film of width × height pixels shows what the crop of `film` shows. Film points are measured up to
/// `margin` of these pixels beyond it.
std::shared_ptr<const Sensor> make_resized(const Sensor& sensor, const FilmGeometry& film,
                                           int width, int height, float margin);

}  // namespace etendue
