#include "scene/scene.h"

#include "math/frame.h"
#include "texture/texture_cache.h"

namespace etendue {
namespace {

/// Normals and points of an instance's shape, moved to the world.
void transform_geometry(const Transform& t, SurfaceGeometry& g) {
    const float side = t.determinant3() < 0 ? -1.0f : 1.0f;
    g.p = t.point(g.p);
    g.ng = normalize(t.normal(g.ng)) * side;
    g.ns = normalize(t.normal(g.ns)) * side;
    g.dpdu = t.vector(g.dpdu);
    g.dpdv = t.vector(g.dpdv);
}

}  // namespace

Scene::Scene() = default;
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;

SurfaceGeometry Scene::surface(const SurfaceLocation& at) const {
    const SceneShape& s = shapes_[at.shape];
    SurfaceGeometry g;
    if (const auto* mesh = s.is_mesh ? static_cast<const TriangleMesh*>(s.shape) : nullptr)
        g = mesh->TriangleMesh::surface(at.prim, at.u, at.v, s.needs_tangents);
    else
        g = s.shape->surface(at.prim, at.u, at.v, s.needs_tangents);
    if (at.instance != kNoInstance)
        transform_geometry(accelerator_.instance_transform(at.instance), g);
    return g;
}

void Scene::fill_hit(const RayHit& raw, SurfaceHit& hit) const {
    hit.geometry = surface(raw);
    hit.shape = &shapes_[raw.shape];
    hit.location = raw;
    hit.t = raw.t;
}

bool Scene::intersect(const Ray& ray, float u, SurfaceHit& hit) const {
    Ray r = ray;
    float travelled = 0;
    RayHit raw;
    while (accelerator_.intersect(r, raw)) {
        fill_hit(raw, hit);
        hit.t += travelled;
        if (!has_masks_ || hit.shape->material->is_opaque()) return true;
        const float opacity = hit.shape->material->opacity(hit.geometry.uv);
        if (u < opacity) return true;
        u = std::min((u - opacity) / (1 - opacity), kOneMinusEpsilon);
        travelled = hit.t;
        r.o = offset_origin(hit.geometry.p, hit.geometry.ng, r.d);
        r.tmax = ray.tmax - travelled;
    }
    return false;
}

float Scene::masked_transmittance(Ray r) const {
    float Tr = 1;
    RayHit raw;
    SurfaceHit hit;
    const float length_d = length(r.d);
    while (accelerator_.intersect(r, raw)) {
        fill_hit(raw, hit);
        if (hit.shape->material->is_opaque()) return 0;
        Tr *= 1 - hit.shape->material->opacity(hit.geometry.uv);
        if (Tr == 0) return 0;
        const Vec3 o = offset_origin(hit.geometry.p, hit.geometry.ng, r.d);
        const float advanced = dot(o - r.o, r.d) / (length_d * length_d);
        r.o = o;
        r.tmax -= advanced;
        if (!(r.tmax > 0)) break;
    }
    return Tr;
}

float Scene::transmittance(Vec3 a, Vec3 ng_a, Vec3 b, Vec3 ng_b) const {
    const Vec3 d = b - a;
    const Vec3 from = offset_origin(a, ng_a, d);
    const Vec3 to = offset_origin(b, ng_b, -d);
    // A segment: the parameter runs from 0 to 1. The end is inside by the rounding of the far surface.
    const Ray ray{from, to - from, 1 - 0x1p-16f};
    if (!has_masks_) return accelerator_.occluded(ray) ? 0.0f : 1.0f;
    return masked_transmittance(ray);
}

float Scene::transmittance_to_infinity(Vec3 a, Vec3 ng_a, Vec3 d) const {
    const Ray ray{offset_origin(a, ng_a, d), d, kInf};
    if (!has_masks_) return accelerator_.occluded(ray) ? 0.0f : 1.0f;
    return masked_transmittance(ray);
}

}  // namespace etendue
