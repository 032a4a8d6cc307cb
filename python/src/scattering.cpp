// BSDFs and rays of the sensor by the array.

#include "arrays.h"
#include "bindings.h"

namespace etendue::python {
namespace {

/// Where BSDFs are: points of shapes, or the materials of shapes in a frame of their own.
struct Places {
    const Scene& scene;
    Column<const int32_t> shape, primitive, instance;  ///< primitive < 0: the frame (x, y, z).
    Rows<const float, 2> parameters;  ///< Within the primitive; texture coordinates in that frame.

    void make(size_t i, Vec3 wo, ComponentArena& arena, Bsdf& bsdf) const {
        const SceneShape& s = scene.shape(uint32_t(shape.data()[i]));
        const Vec2 uv{parameters.data()[2 * i], parameters.data()[2 * i + 1]};
        arena.reset();
        if (primitive.data()[i] < 0) {
            const Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
            return s.material->make_bsdf({{}, z, z, x, y, uv, wo}, arena, bsdf);
        }
        const SurfaceGeometry g =
            scene.surface({uint32_t(shape.data()[i]), uint32_t(primitive.data()[i]),
                           uint32_t(instance.data()[i]), uv.x, uv.y});
        s.material->make_bsdf(
            {g.p, g.ng, g.ns, g.dpdu, g.dpdv, g.uv, wo, g.color, g.alpha, g.second_uv}, arena,
            bsdf);
    }
};

/// Places of another scene have numbers that this one may not have.
void check(const Places& at) {
    const size_t shapes = at.scene.shapes().size(), instances = at.scene.statistics().instances;
    const auto is_one_of = [](int32_t number, size_t count) {
        return number >= 0 && size_t(number) < count;
    };
    for (size_t i = 0; i < at.shape.size(); ++i) {
        const int32_t shape = at.shape.data()[i], primitive = at.primitive.data()[i],
                      instance = at.instance.data()[i];
        if (is_one_of(shape, shapes) &&
            (primitive < 0 ||
             is_one_of(primitive, at.scene.shape(uint32_t(shape)).shape->primitive_count())) &&
            (instance < 0 || is_one_of(instance, instances)))
            continue;
        throw nb::value_error("these are hits of another scene");
    }
}

/// Calls body(i, bsdf) with the BSDF of each place.
template <class Body>
void for_each_bsdf(const Places& at, const Rows<const float, 3>& wo, const Body& body) {
    check(at);
    struct Scratch {
        ComponentArena arena;
        Bsdf bsdf;
    };
    for_each_grain(at.shape.size(), [&](size_t first, size_t end) {
        Scratch scratch;
        for (size_t i = first; i < end; ++i) {
            at.make(i, row(wo, i), scratch.arena, scratch.bsdf);
            body(i, scratch.bsdf);
        }
    });
}

TransportMode mode_of(bool is_importance) {
    return is_importance ? TransportMode::Importance : TransportMode::Radiance;
}

void eval_bsdfs(const ScenePtr& scene, const Column<const int32_t>& shape,
                const Column<const int32_t>& primitive, const Column<const int32_t>& instance,
                const Rows<const float, 2>& parameters, const Rows<const float, 3>& wo,
                const Rows<const float, 3>& wi, bool is_importance, const Rows<float, 3>& f,
                const Column<float>& pdf) {
    const Places at{scene->scene, shape, primitive, instance, parameters};
    for_each_bsdf(at, wo, [&](size_t i, const Bsdf& bsdf) {
        const BsdfEval e = bsdf.eval(row(wo, i), row(wi, i), mode_of(is_importance));
        set_row(f, i, {e.f.r, e.f.g, e.f.b});
        pdf.data()[i] = e.pdf;
    });
}

/// Of samples that end the path, the outputs stay as they are.
void sample_bsdfs(const ScenePtr& scene, const Column<const int32_t>& shape,
                  const Column<const int32_t>& primitive, const Column<const int32_t>& instance,
                  const Rows<const float, 2>& parameters, const Rows<const float, 3>& wo,
                  const Column<const float>& u_lobe, const Rows<const float, 2>& u,
                  bool is_importance, const Rows<float, 3>& wi, const Rows<float, 3>& weight,
                  const Column<float>& pdf, const Column<bool>& is_delta) {
    const Places at{scene->scene, shape, primitive, instance, parameters};
    for_each_bsdf(at, wo, [&](size_t i, const Bsdf& bsdf) {
        const Vec2 u_direction{u.data()[2 * i], u.data()[2 * i + 1]};
        const auto s =
            bsdf.sample(row(wo, i), u_lobe.data()[i], u_direction, mode_of(is_importance));
        if (!s) return;
        set_row(wi, i, s->wi);
        set_row(weight, i, {s->weight.r, s->weight.g, s->weight.b});
        pdf.data()[i] = s->pdf;
        is_delta.data()[i] = s->is_delta;
    });
}

void sensor_rays(const ScenePtr& scene, const Rows<const float, 2>& film,
                 const Rows<const float, 2>& lens, const Rows<float, 3>& o, const Rows<float, 3>& d,
                 const Column<float>& pdf_position, const Column<float>& pdf_direction) {
    const Sensor& sensor = scene->scene.sensor();
    for_each_row(pdf_position.size(), [&](size_t i) {
        const SensorRay ray = sensor.sample_ray({film.data()[2 * i], film.data()[2 * i + 1]},
                                                {lens.data()[2 * i], lens.data()[2 * i + 1]});
        set_row(o, i, ray.p);
        set_row(d, i, ray.d);
        pdf_position.data()[i] = ray.pdf_pos;
        pdf_direction.data()[i] = ray.pdf_dir;
    });
}

}  // namespace

void bind_scattering(nb::module_& m) {
    using namespace nb::literals;
    m.def("eval_bsdfs", &eval_bsdfs, "scene"_a, "shape"_a, "primitive"_a, "instance"_a,
          "parameters"_a, "wo"_a, "wi"_a, "is_importance"_a, "f"_a, "pdf"_a);
    m.def("sample_bsdfs", &sample_bsdfs, "scene"_a, "shape"_a, "primitive"_a, "instance"_a,
          "parameters"_a, "wo"_a, "u_lobe"_a, "u"_a, "is_importance"_a, "wi"_a, "weight"_a, "pdf"_a,
          "is_delta"_a);
    m.def("sensor_rays", &sensor_rays, "scene"_a, "film"_a, "lens"_a, "o"_a, "d"_a,
          "pdf_position"_a, "pdf_direction"_a);
}

}  // namespace etendue::python
