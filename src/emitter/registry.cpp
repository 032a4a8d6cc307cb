#include "emitter/area.h"
#include "emitter/infinite.h"
#include "emitter/point.h"

namespace etendue {

const std::vector<EmitterEntry>& emitter_registry() {
    static const std::vector<EmitterEntry> entries = {
        area_entry(),       point_entry(),     spot_entry(),        goniometric_entry(),
        projection_entry(), projector_entry(), directional_entry(), constant_entry(),
        envmap_entry(),     sky_entry(),       sun_entry(),         sunsky_entry()};
    return entries;
}

EmitterHit Emitter::eval_surface(Vec3, Vec2, uint32_t, Vec3) const {
    return {};
}

EmitterHit Emitter::eval_infinite(Vec3) const {
    return {};
}

}  // namespace etendue
