#include "bsdf/material.h"

namespace etendue {

void ComponentList::add(const Frame& frame, const Lobe& lobe, float weight) {
    if (!(weight > 0)) return;
    const BsdfComponent component{
        .frame = frame, .lobe = lobe, .weight = weight, .next = first_.next};
    if (count_++ == 0)
        first_ = component;
    else
        first_.next = arena_->keep(component);
}

Bsdf Material::bsdf(const SurfacePoint& point, ComponentArena& arena) const {
    ComponentList list(arena);
    append(point, Frame::from_normal_and_tangent(point.ns, point.dpdu), 1, list);
    if (list.empty()) return {};
    return {point.ng, list.first()};
}

}  // namespace etendue
