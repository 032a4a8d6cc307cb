#include "bsdf/material.h"

namespace etendue {

void Material::make_bsdf(const SurfacePoint& point, ComponentArena& arena, Bsdf& out) const {
    const Frame frame = Frame::from_normal_and_tangent(point.ns, point.dpdu);
    ComponentList list(point.ng, frame, has_strict_normals_, arena, out);
    append(point, frame, 1, list);
}

}  // namespace etendue
