#include "sensor/sensor.h"

#include "sensor/orthographic.h"
#include "sensor/perspective.h"

namespace etendue {

std::optional<SensorSample> Sensor::hit_lens(Vec3, Vec3, float) const {
    return {};
}

const std::vector<SensorEntry>& sensor_registry() {
    static const std::vector<SensorEntry> entries = {perspective_entry(), thinlens_entry(),
                                                     orthographic_entry()};
    return entries;
}

}  // namespace etendue
