#include "bsdf/material.h"

namespace etendue {

void Material::make_bsdf(const SurfacePoint& point, ComponentArena& arena, Bsdf& out) const {
    ComponentList list(point.ng, has_strict_normals_, arena, out);
    append(point, Frame::from_normal_and_tangent(point.ns, point.dpdu), 1, list);
}

}  // namespace etendue
