#pragma once
// A sensor whose film has another resolution.

#include <memory>

#include "sensor/sensor.h"

namespace etendue {

/// `sensor`, of which a film of width × height pixels shows what the crop of `film` shows. Within the filter's radius of the
/// edges, measurements are those of `sensor`.
std::shared_ptr<const Sensor> make_resized(std::shared_ptr<const Sensor> sensor,
                                           const FilmGeometry& film, int width, int height);

}  // namespace etendue
