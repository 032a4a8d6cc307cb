#pragma once

#include "sensor/sensor.h"

namespace etendue {

SensorEntry orthographic_entry();

}  // namespace etendue
