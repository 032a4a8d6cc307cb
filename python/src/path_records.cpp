// The paths of a rendering, as arrays.

#include <cmath>

#include <nanobind/stl/string.h>

#include "pathspace/path_pdfs.h"
#include "render/render_request.h"
#include "render/renderer.h"
#include "sub_paths.h"
#include "values.h"

namespace etendue::python {
namespace {

struct PathRecord {
    int32_t s, t, strategy, pixel, vertices;
    float mis_weight;
    float contribution[3], film[2];
};

/// The first paths of a rendering: vertices and contributions.
class PathRecorder final : public ContributionObserver {
public:
    PathRecorder(const Scene& scene, size_t count, size_t most_vertices)
        : scene_(scene), count_(count), most_vertices_(most_vertices) {}

    void observe(const Join& join, Rgb contribution, float share, const FilmTarget& target,
                 const Workspace& work) override {
        const Technique& q = join.technique;
        if (records.size() >= count_ || size_t(q.vertices()) > most_vertices_ ||
            is_pair(q.strategy)) {
            is_full = records.size() >= count_;
            return;
        }
        const Rgb c = contribution * share;
        records.push_back({q.s,
                           q.t,
                           int32_t(q.strategy),
                           int32_t(target.pixel.value_or(scene_.film().pixel_at(target.point))),
                           q.vertices(),
                           join.mis_weight,
                           {c.r, c.g, c.b},
                           {join.film.x, join.film.y}});
        std::vector<Vec3> x;
        for (int i = 0; i < q.s; ++i)
            x.push_back(i == 0 && q.strategy == Strategy::NextEvent ? join.b.p
                                                                    : work.light_side(q)[i].p);
        for (int i = q.t - 1; i >= 0; --i)
            x.push_back(i == 0 && q.strategy == Strategy::Splat ? lens_end(scene_, join).p
                                                                : work.z[i].p);
        x.resize(most_vertices_, Vec3{std::nanf(""), std::nanf(""), std::nanf("")});
        for (const Vec3& p : x) points.insert(points.end(), {p.x, p.y, p.z});
        is_full = records.size() >= count_;
    }

    std::vector<PathRecord> records;
    std::vector<float> points;  ///< 3 · most_vertices of each record.
    std::atomic<bool> is_full{false};

private:
    const Scene& scene_;
    size_t count_, most_vertices_;
};

nb::tuple sample_paths(const ScenePtr& scene, size_t n, nb::handle integrator, uint64_t seed,
                       int most_vertices, const std::string& sampler) {
    use_threads();
    PathRecorder recorder(scene->scene, n,
                          size_t(checked("max_vertices", most_vertices, 2, kMostVertices)));
    RenderSettings settings;
    settings.integrator = to_spec(scene->scene, integrator);
    settings.sampler = sampler_named(sampler, "sampler");
    settings.seed = seed;
    settings.threads = 1;
    settings.observer = &recorder;
    settings.spp = 1024;
    Background background;
    background.run(
        [&] {
            Renderer renderer(scene->scene, settings);
            renderer.run(
                [&](const Progress&) {
                    if (recorder.is_full) background.stop = true;
                },
                background.stop, recorder.is_full);
        },
        [] {});
    if (background.interrupted) {
        PyErr_SetNone(PyExc_KeyboardInterrupt);
        throw nb::python_error();
    }
    const auto bytes = [](const void* data, size_t size) {
        return nb::bytes(static_cast<const char*>(data), size);
    };
    return nb::make_tuple(
        bytes(recorder.records.data(), recorder.records.size() * sizeof(PathRecord)),
        bytes(recorder.points.data(), recorder.points.size() * sizeof(float)));
}

}  // namespace

void bind_path_records(nb::module_& m) {
    using namespace nb::literals;
    m.def("sample_paths", &sample_paths, "scene"_a, "n"_a, "integrator"_a, "seed"_a,
          "most_vertices"_a, "sampler"_a);
}

}  // namespace etendue::python
