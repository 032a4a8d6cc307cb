// Rays by the array: their first hits, and whether they hit anything.

#include "arrays.h"
#include "bindings.h"

namespace etendue::python {
namespace {

bool intersect(const Scene& scene, const Ray& ray, SurfaceHit& hit) {
    // Masked surfaces let the ray pass as long as more than half of it is left.
    return scene.intersect(ray, 0.5f, hit);
}

/// Of rays that hit nothing, the outputs stay as they are. All arrays have the same number of rows.
void intersect_rays(const ScenePtr& handle, const Rows<const float, 3>& o,
                    const Rows<const float, 3>& d, const Column<const float>& tmax,
                    const Column<float>& t, const Rows<float, 3>& p, const Rows<float, 3>& ng,
                    const Rows<float, 3>& ns, const Rows<float, 2>& uv,
                    const Column<int32_t>& shape, const Column<int32_t>& primitive,
                    const Column<float>& slack, const Column<int32_t>& instance,
                    const Rows<float, 2>& parameters) {
    const Scene& scene = handle->scene;
    for_each_row(t.size(), [&](size_t i) {
        SurfaceHit hit;
        if (!intersect(scene, {row(o, i), row(d, i), tmax.data()[i]}, hit)) return;
        t.data()[i] = hit.t;
        set_row(p, i, hit.geometry.p);
        set_row(ng, i, hit.geometry.ng);
        set_row(ns, i, hit.geometry.ns);
        uv.data()[2 * i] = hit.geometry.uv.x;
        uv.data()[2 * i + 1] = hit.geometry.uv.y;
        shape.data()[i] = int32_t(hit.location.shape);
        primitive.data()[i] = int32_t(hit.location.prim);
        slack.data()[i] = hit.geometry.slack;
        instance.data()[i] = int32_t(hit.location.instance);
        parameters.data()[2 * i] = hit.location.u;
        parameters.data()[2 * i + 1] = hit.location.v;
    });
}

void occluded_rays(const ScenePtr& handle, const Rows<const float, 3>& o,
                   const Rows<const float, 3>& d, const Column<const float>& tmax,
                   const Column<bool>& occluded) {
    const Scene& scene = handle->scene;
    for_each_row(occluded.size(), [&](size_t i) {
        const Ray ray{row(o, i), row(d, i), tmax.data()[i]};
        SurfaceHit hit;
        occluded.data()[i] = scene.has_masks()
                                 ? intersect(scene, ray, hit)
                                 : scene.accelerator().obstacle(ray) != Obstacle::None;
    });
}

void offset_origins(const Rows<const float, 3>& p, const Rows<const float, 3>& ng,
                    const Column<const float>& slack, const Rows<const float, 3>& d,
                    const Rows<float, 3>& origins) {
    for (size_t i = 0; i < slack.size(); ++i)
        set_row(origins, i, offset_origin({row(p, i), row(ng, i), slack.data()[i]}, row(d, i)));
}

}  // namespace

void bind_rays(nb::module_& m) {
    using namespace nb::literals;
    m.def("intersect_rays", &intersect_rays, "scene"_a, "o"_a, "d"_a, "tmax"_a, "t"_a, "p"_a,
          "ng"_a, "ns"_a, "uv"_a, "shape"_a, "primitive"_a, "slack"_a, "instance"_a,
          "parameters"_a);
    m.def("occluded_rays", &occluded_rays, "scene"_a, "o"_a, "d"_a, "tmax"_a, "occluded"_a);
    m.def("offset_origins", &offset_origins, "p"_a, "ng"_a, "slack"_a, "d"_a, "origins"_a);
}

}  // namespace etendue::python
