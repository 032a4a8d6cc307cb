#include "reuse/photon_importance.h"

namespace etendue {

PhotonImportance::PhotonImportance(std::span<const Importon> importons, float radius)
    : radius_(radius) {
    std::vector<PointGrid::Entry> entries;
    entries.reserve(importons.size());
    const float per_area = 1 / (kPi * sqr(radius));
    for (const Importon& i : importons)
        if (i.importance > 0)
            entries.push_back({.p = i.p,
                               .index = 0,
                               .tag = i.side.bits() | (i.is_caustic ? kCaustic : 0u),
                               .weight = i.importance * per_area});
    grid_.build(entries, radius);
}

float PhotonImportance::operator()(const MapPhoton& photon) const {
    float sum = floor_;
    grid_.for_each_near(photon.p, radius_, [&](const PointGrid::Entry& e) {
        if ((e.tag & kCaustic) && !photon.is_caustic()) return;
        // An importon does not count for photons on the other side of its surface.
        const ArrivalSide side = ArrivalSide::from_bits(e.tag & 0xffff);
        if (side.is_transmissive() || dot(side.normal(), photon.wi) > 0) sum += e.weight;
    });
    return sum;
}

}  // namespace etendue
