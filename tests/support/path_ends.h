#pragma once
// End points that are sampled by joins, as vertices for the reference definitions of path_pdfs.h.

#include "pathspace/join.h"

namespace etendue::test {

/// x_0 of a next event; `next` is x_1.
inline Vertex emitter_end(const Join& join, const Vertex& next) {
    Vertex x0;
    x0.kind = Vertex::Kind::Emitter;
    x0.emitter = join.emitter;
    x0.p = join.b;
    x0.ng = join.ng_b;
    x0.is_infinite = join.to_infinity;
    x0.has_cosine = join.emitter->is_area();
    if (!x0.has_cosine) x0.ng = x0.is_infinite ? -x0.p : normalize(next.p - x0.p);
    return x0;
}

/// x_k of a splat.
inline Vertex lens_end(const Scene& scene, const Join& join) {
    Vertex lens;
    lens.kind = Vertex::Kind::Sensor;
    lens.is_infinite = scene.sensor().is_orthographic();
    const SensorRay ray = scene.sensor().sample_ray(join.film, {0.5f, 0.5f});
    lens.ng = ray.ng;
    lens.p = lens.is_infinite ? -ray.ng : join.a;
    lens.pdf_fwd = ray.pdf_pos;
    return lens;
}

}  // namespace etendue::test
