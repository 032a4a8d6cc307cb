#include "sub_paths.h"

#include <array>

#include <fmt/format.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "pathspace/path_pdfs.h"
#include "render/render_request.h"

namespace etendue::python {
namespace {

const char* kind_of(const Vertex& v) {
    switch (v.kind) {
    case Vertex::Kind::Sensor: return "sensor";
    case Vertex::Kind::Emitter: return "emitter";
    case Vertex::Kind::Surface: return v.is_infinite ? "infinity" : "surface";
    }
    return "";
}

/// One row for each vertex.
template <class Get>
FloatArray rows(const Path& path, size_t columns, const Get& get) {
    const SubPath& p = path.sub_path();
    auto* values = new std::vector<float>();
    for (int i = 0; i < p.size(); ++i) {
        const auto v = get(p[i]);
        values->insert(values->end(), v.begin(), v.end());
    }
    nb::capsule owner(values, [](void* q) noexcept { delete static_cast<std::vector<float>*>(q); });
    const auto n = size_t(p.size());
    if (columns == 1) return FloatArray(values->data(), {n}, owner);
    return FloatArray(values->data(), {n, columns}, owner);
}
std::array<float, 3> triple(Vec3 v) {
    return {v.x, v.y, v.z};
}
std::array<float, 3> triple(Rgb c) {
    return {c.r, c.g, c.b};
}

Vec3 to_vec(const std::array<float, 3>& v) {
    return {v[0], v[1], v[2]};
}

TransportMode mode_of(const std::string& name) {
    if (name == "radiance") return TransportMode::Radiance;
    if (name == "importance") return TransportMode::Importance;
    throw nb::value_error("mode must be \"radiance\" or \"importance\"");
}

uint64_t pixel_index(const Scene& scene, std::pair<int, int> pixel) {
    const auto [x, y] = pixel;
    if (x < 0 || y < 0 || x >= scene.film().crop_width || y >= scene.film().crop_height)
        throw nb::index_error("pixel must lie within the image");
    return scene.film().pixel_index(x, y);
}

PathPtr trace(const ScenePtr& scene, std::optional<std::pair<int, int>> pixel, uint64_t path,
              uint64_t seed, uint32_t pass, std::optional<int> max_vertices,
              std::optional<int> rr_depth, const TechniqueCounts& counts,
              const std::string& sampler_name) {
    auto out = std::make_shared<Path>(scene, counts);
    RenderStats stats;
    const WalkContext walk{scene->scene, counts, stats, walk_options(max_vertices, rr_depth)};
    Sampler sampler(sampler_named(sampler_name, "sampler"), seed);
    sampler.start(pass, pixel ? pixel_index(scene->scene, *pixel) : path);
    if (pixel)
        trace_eye_path(walk, scene->film(), pixel_index(scene->scene, *pixel), sampler, out->own);
    else
        trace_light_path(walk, sampler, out->own);
    return out;
}

VertexHandle end_vertex(Vertex vertex, const ScenePtr& scene) {
    VertexHandle v;
    v.own = std::make_shared<Vertex>(vertex);
    v.scene = scene;
    return v;
}

std::vector<VertexHandle> vertices_of(const JoinHandle& j) {
    const Technique& q = j.join.technique;
    std::vector<VertexHandle> x;
    for (int i = 0; i < q.s; ++i) {
        if (i == 0 && q.strategy == Strategy::NextEvent)
            x.push_back(end_vertex(emitter_end(j.join, j.z->sub_path()[q.t - 1]), j.scene));
        else
            x.push_back({j.y, i, nullptr, nullptr, nullptr});
    }
    for (int i = q.t - 1; i >= 0; --i) {
        if (i == 0 && q.strategy == Strategy::Splat)
            x.push_back(end_vertex(lens_end(j.scene->scene, j.join), j.scene));
        else
            x.push_back({j.z, i, nullptr, nullptr, nullptr});
    }
    return x;
}

PathValue evaluate(const ScenePtr& scene, const std::vector<VertexHandle>& x,
                   std::optional<std::vector<bool>> delta) {
    if (x.size() < 2) throw nb::value_error("a path has at least two vertices");
    std::vector<const Vertex*> vertices;
    for (const VertexHandle& v : x) vertices.push_back(&v.vertex());
    if (!vertices.front()->emitter) throw nb::value_error("x[0] must lie on an emitter");
    if (vertices.back()->kind != Vertex::Kind::Sensor)
        throw nb::value_error("the last vertex must lie on the lens");
    if (!delta) delta = std::vector<bool>(x.size());
    if (delta->size() != x.size()) throw nb::value_error("delta needs one flag for each vertex");
    return evaluate_path(scene->scene, vertices, *delta);
}

std::optional<VertexHandle> vertex_at(const ScenePtr& scene, const std::array<float, 3>& o,
                                      const std::array<float, 3>& d) {
    const Vec3 direction = normalize(to_vec(d));
    SurfaceHit hit;
    if (!scene->scene.intersect(Ray{to_vec(o), direction}, 0.5f, hit)) return {};
    VertexHandle v;
    v.own = std::make_shared<Vertex>();
    v.arena = std::make_shared<ComponentArena>();
    v.scene = scene;
    v.own->beta = Rgb(1);
    v.own->set_surface(*hit.shape, hit.location, hit.geometry, -direction, *v.arena);
    return v;
}

void bind_vertices(nb::module_& m) {
    using namespace nb::literals;
    const auto vec = [](Vec3 v) { return to_array(v); };
    nb::class_<VertexHandle>(m, "Vertex",
                             "A vertex of a path. It keeps its sub-path and scene alive.")
        .def_prop_ro(
            "p", [vec](const VertexHandle& v) { return vec(v.vertex().p); },
            nb::rv_policy::automatic,
            "Position, shape (3,), in scene units; at infinity the unit direction toward it.")
        .def_prop_ro(
            "ng", [vec](const VertexHandle& v) { return vec(v.vertex().ng); },
            nb::rv_policy::automatic, "Unit geometric normal, shape (3,).")
        .def_prop_ro(
            "ns",
            [vec](const VertexHandle& v) {
                const Vertex& x = v.vertex();
                return vec(x.kind == Vertex::Kind::Surface && !x.is_infinite
                               ? x.bsdf.shading_normal()
                               : x.ng);
            },
            nb::rv_policy::automatic,
            "Unit shading normal, shape (3,); the geometric one at end points.")
        .def_prop_ro(
            "wo", [vec](const VertexHandle& v) { return vec(v.vertex().wo); },
            nb::rv_policy::automatic,
            "Unit direction toward the predecessor, shape (3,); undefined at the first vertex.")
        .def_prop_ro(
            "beta", [](const VertexHandle& v) { return to_array(v.vertex().beta); },
            nb::rv_policy::automatic,
            "Throughput up to, not including, scattering here; linear RGB, shape (3,).")
        .def_prop_ro(
            "pdf_fwd", [](const VertexHandle& v) { return v.vertex().pdf_fwd; },
            "Density as sampled from the predecessor, per unit area (per steradian at "
            "infinity).")
        .def_prop_ro(
            "pdf_rev", [](const VertexHandle& v) { return v.vertex().pdf_rev; },
            "Density as it would be sampled from the successor, per unit area; 0 at the last "
            "two vertices, where it is not known yet.")
        .def_prop_ro(
            "kind", [](const VertexHandle& v) { return std::string(kind_of(v.vertex())); },
            "A text: sensor, emitter, surface or infinity.")
        .def_prop_ro(
            "is_delta", [](const VertexHandle& v) { return v.vertex().is_delta; },
            "Whether the walk left this vertex by a delta event, such as a mirror's.")
        .def_prop_ro(
            "is_infinite", [](const VertexHandle& v) { return v.vertex().is_infinite; },
            "Whether it is at infinity.")
        .def_prop_ro(
            "is_connectible", [](const VertexHandle& v) { return v.vertex().is_connectible; },
            "Whether another vertex can be connected to it.")
        .def_prop_ro(
            "on_emitter", [](const VertexHandle& v) { return v.vertex().emitter != nullptr; },
            "Whether it lies on an emitter.")
        .def(
            "eval",
            [](const VertexHandle& v, const std::array<float, 3>& w, const std::string& mode) {
                const BsdfEval e = v.vertex().eval(normalize(to_vec(w)), mode_of(mode));
                return std::pair{to_array(e.f), e.pdf};
            },
            "w"_a, "mode"_a = "radiance",
            "f |cos| toward the direction w, linear RGB per steradian, shape (3,), and the density "
            "of "
            "sample() for w, per steradian; of smooth lobes only. mode: \"radiance\" on eye paths, "
            "\"importance\" on light paths.")
        .def(
            "sample",
            [](const VertexHandle& v, float u_lobe, std::pair<float, float> u,
               const std::string& mode)
                -> std::optional<std::tuple<FloatArray, FloatArray, float, bool>> {
                const auto s =
                    v.vertex().sample_unguided(u_lobe, {u.first, u.second}, mode_of(mode));
                if (!s) return {};
                return std::tuple{to_array(s->wi), to_array(s->weight), s->pdf, s->is_delta};
            },
            "u_lobe"_a, "u"_a, "mode"_a = "radiance",
            "A direction for the random numbers u_lobe and u in [0, 1): the unit direction, shape "
            "(3,); the weight f |cos| / density, linear RGB, shape (3,); the density per "
            "steradian, or "
            "the probability of a delta event; and whether it is one. None where the walk ends.")
        .def("__repr__", [](const VertexHandle& v) {
            const Vertex& x = v.vertex();
            return fmt::format("<Vertex {} at ({:.4g}, {:.4g}, {:.4g})>", kind_of(x), x.p.x, x.p.y,
                               x.p.z);
        });
}

void bind_paths(nb::module_& m) {
    using namespace nb::literals;
    nb::class_<Path>(
        m, "SubPath",
        "A light path y_0 ... or an eye path z_0 ..., without its joins. Arrays have one "
        "row for each vertex.")
        .def("__len__", [](const Path& p) { return p.sub_path().size(); })
        .def(
            "__getitem__",
            [](const PathPtr& p, int i) {
                const int n = p->sub_path().size();
                if (i < 0) i += n;
                if (i < 0 || i >= n) throw nb::index_error("there is no such vertex");
                return VertexHandle{p, i, nullptr, nullptr, nullptr};
            },
            "i"_a, "Vertex i, which keeps the sub-path alive.")
        .def_prop_ro(
            "p",
            [](const Path& p) { return rows(p, 3, [](const Vertex& v) { return triple(v.p); }); },
            nb::rv_policy::automatic,
            "Positions, shape (n, 3), in scene units; at infinity unit directions.")
        .def_prop_ro(
            "ng",
            [](const Path& p) { return rows(p, 3, [](const Vertex& v) { return triple(v.ng); }); },
            nb::rv_policy::automatic, "Unit geometric normals, shape (n, 3).")
        .def_prop_ro(
            "ns",
            [](const Path& p) {
                return rows(p, 3, [](const Vertex& v) {
                    const bool is_surface = v.kind == Vertex::Kind::Surface && !v.is_infinite;
                    return triple(is_surface ? v.bsdf.shading_normal() : v.ng);
                });
            },
            nb::rv_policy::automatic, "Unit shading normals, shape (n, 3).")
        .def_prop_ro(
            "beta",
            [](const Path& p) {
                return rows(p, 3, [](const Vertex& v) { return triple(v.beta); });
            },
            nb::rv_policy::automatic,
            "Throughputs up to, not including, scattering at the vertex; linear RGB, shape (n, 3).")
        .def_prop_ro(
            "pdf_fwd",
            [](const Path& p) {
                return rows(p, 1, [](const Vertex& v) { return std::array{v.pdf_fwd}; });
            },
            nb::rv_policy::automatic,
            "Densities as sampled from the predecessor, per unit area, shape (n,).")
        .def_prop_ro(
            "pdf_rev",
            [](const Path& p) {
                return rows(p, 1, [](const Vertex& v) { return std::array{v.pdf_rev}; });
            },
            nb::rv_policy::automatic,
            "Densities as sampled from the successor, per unit area, shape (n,); 0 at the last "
            "two.")
        .def_prop_ro(
            "film",
            [](const Path& p) {
                return std::pair{p.sub_path().film.x, p.sub_path().film.y};
            },
            "Film point of an eye path, in pixels from the upper left corner.")
        .def("__repr__", [](const Path& p) {
            return fmt::format("<SubPath of {} vertices>", p.sub_path().size());
        });
}

void bind_joins(nb::module_& m) {
    using namespace nb::literals;
    nb::class_<JoinHandle>(m, "Join", "A whole path, made from a light and an eye sub-path.")
        .def_prop_ro(
            "technique", [](const JoinHandle& j) { return j.join.technique; },
            "How the path was made.")
        .def_prop_ro(
            "contribution", [](const JoinHandle& j) { return to_array(j.contribution); },
            nb::rv_policy::automatic,
            "Unweighted contribution f / p after the shadow ray, linear RGB radiance, shape "
            "(3,); for t = 1 that of one light path.")
        .def_prop_ro(
            "mis_weight", [](const JoinHandle& j) { return j.join.mis_weight; },
            "Weight of the power heuristic among all techniques with counts above 0.")
        .def_prop_ro(
            "film",
            [](const JoinHandle& j) {
                return std::pair{j.join.film.x, j.join.film.y};
            },
            "Film point, in pixels from the upper left corner.")
        .def(
            "vertices", &vertices_of,
            "The vertices x_0 (on the emitter) to x_k (on the lens), end points that the technique "
            "sampled included.")
        .def_prop_ro(
            "delta",
            [](const JoinHandle& j) {
                const Technique& q = j.join.technique;
                std::vector<bool> delta;
                const std::vector<VertexHandle> x = vertices_of(j);
                for (int i = 0; i < int(x.size()); ++i)
                    delta.push_back(i > 0 && i + 1 < int(x.size()) && i != q.s - 1 && i != q.s &&
                                    x[size_t(i)].vertex().is_delta);
                return delta;
            },
            "Whether the path scatters by a delta event, for each of vertices().")
        .def("__repr__", [](const JoinHandle& j) {
            const Technique& q = j.join.technique;
            return fmt::format("<Join {} s={} t={}>", name_of(q.strategy), q.s, q.t);
        });
}

}  // namespace

WalkOptions walk_options(std::optional<int> max_vertices, std::optional<int> rr_depth) {
    if (max_vertices && *max_vertices < 1) throw nb::value_error("max_vertices must be at least 1");
    if (rr_depth && *rr_depth < 1) throw nb::value_error("rr_depth must be at least 1");
    return {std::min(max_vertices.value_or(kMostVertices), kMostVertices),
            rr_depth.value_or(kNoRoulette)};
}

std::vector<JoinHandle> joins(const ScenePtr& kept, const PathPtr& y, int s, const PathPtr& z,
                              int t, Sampler& sampler, const TechniqueCounts& counts,
                              RenderStats& stats) {
    const Scene& scene = kept->scene;
    if (s < 0 || t < 1) throw nb::value_error("s must be at least 0, and t at least 1");
    if (s + t < 2) throw nb::value_error("a path has at least two vertices");
    const bool needs_y = uses_light_path(s, t), needs_z = uses_eye_path(t);
    if (needs_y && (!y || s > y->sub_path().size()))
        throw nb::index_error("the light sub-path has fewer than s vertices");
    if (needs_z && (!z || t > z->sub_path().size()))
        throw nb::index_error("the eye sub-path has fewer than t vertices");
    std::vector<JoinHandle> all;
    const auto add = [&](const Join& j, float Tr) {
        if (Tr > 0) all.push_back({j, j.contribution * Tr, y, z, kept});
    };
    if (t == 1) {
        if (const auto j = join_splat(scene, y->sub_path(), s, sampler, counts))
            add(*j, visibility(scene, *j, stats));
    } else if (s == 0) {
        for_each_hit(scene, z->sub_path(), t, counts, [&](const Join& j) { add(j, 1); });
    } else if (s == 1) {
        if (const auto j = join_next_event(scene, z->sub_path(), t, sampler, counts))
            add(*j, visibility(scene, *j, stats));
    } else if (const auto j = join_connect(scene, y->sub_path(), s, z->sub_path(), t, counts)) {
        add(*j, visibility(scene, *j, stats));
    }
    return all;
}

void bind_sub_paths(nb::module_& m) {
    using namespace nb::literals;
    bind_vertices(m);
    bind_paths(m);
    bind_joins(m);
    m.def(
        "eye_path",
        [](const ScenePtr& scene, std::pair<int, int> pixel, uint64_t seed, uint32_t pass,
           std::optional<int> max_vertices, std::optional<int> rr_depth,
           const TechniqueCounts& counts, const std::string& sampler) {
            return trace(scene, pixel, 0, seed, pass, max_vertices, rr_depth, counts, sampler);
        },
        "scene"_a, "pixel"_a, "seed"_a, "pass_"_a, "max_vertices"_a.none(), "rr_depth"_a.none(),
        "counts"_a, "sampler"_a);
    m.def(
        "light_path",
        [](const ScenePtr& scene, uint64_t path, uint64_t seed, uint32_t pass,
           std::optional<int> max_vertices, std::optional<int> rr_depth,
           const TechniqueCounts& counts, const std::string& sampler) {
            return trace(scene, {}, path, seed, pass, max_vertices, rr_depth, counts, sampler);
        },
        "scene"_a, "path"_a, "seed"_a, "pass_"_a, "max_vertices"_a.none(), "rr_depth"_a.none(),
        "counts"_a, "sampler"_a);
    m.def("vertex_at", &vertex_at, "scene"_a, "o"_a, "d"_a);
    m.def(
        "join",
        [](const ScenePtr& scene, const PathPtr& y, int s, const PathPtr& z, int t, uint64_t seed,
           const std::optional<TechniqueCounts>& counts) {
            Sampler sampler(SamplerKind::Independent, seed);
            sampler.start(0, 0);
            RenderStats stats;
            const TechniqueCounts own = z ? z->counts : y ? y->counts : TechniqueCounts{};
            return joins(scene, y, s, z, t, sampler, counts.value_or(own), stats);
        },
        "scene"_a, "y"_a.none(), "s"_a, "z"_a.none(), "t"_a, "seed"_a, "counts"_a.none());
    m.def(
        "evaluate",
        [](const ScenePtr& scene, const std::vector<VertexHandle>& x,
           const std::optional<std::vector<bool>>& delta) {
            PathValue v = evaluate(scene, x, delta);
            return std::pair{to_array(v.f), v.pdfs};
        },
        "scene"_a, "x"_a, "delta"_a.none());
}

}  // namespace etendue::python
