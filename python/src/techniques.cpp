// Techniques, the numbers of their samples, their densities and weights.

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bindings.h"
#include "pathspace/path_pdfs.h"

namespace etendue::python {
namespace {

constexpr std::pair<const char*, Strategy> kStrategies[] = {
    {"hit", Strategy::Hit},          {"next_event", Strategy::NextEvent},
    {"connect", Strategy::Connect},  {"splat", Strategy::Splat},
    {"hit_lens", Strategy::HitLens}, {"merge", Strategy::Merge},
    {"gather", Strategy::Gather},    {"specular", Strategy::Specular}};

Technique make_technique(int s, int t, const std::optional<std::string>& strategy, bool drops_eye) {
    if (s < 0 || t < 0 || s + t < 2) throw nb::value_error("s and t count the vertices of a path");
    if (!strategy) return connection_technique(s, t);
    for (const auto& [name, value] : kStrategies)
        if (*strategy == name) return {value, s, t, drops_eye};
    throw nb::value_error("strategy must be hit, next_event, connect, splat, hit_lens, merge, "
                          "gather or specular");
}

template <class T>
nb::ndarray<nb::numpy, T> vector_array(const std::vector<T>& values) {
    auto* kept = new std::vector<T>(values);
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::ndarray<nb::numpy, T>(kept->data(), {kept->size()}, owner);
}

void bind_counts(nb::module_& m) {
    using namespace nb::literals;
    using F = TechniqueCounts;
    nb::class_<F>(
        m, "Counts",
        "Number of samples that each strategy takes, as the MIS weights count them: 1 for "
        "one eye path a pixel, N_L (the number of light paths) for techniques that reach "
        "any pixel, 0 for strategies that are not used. Dimensionless.")
        .def(
            "__init__",
            [](F* self, float hit, float next_event, float connect, float splat, float continued) {
                if (!(continued > 0 && continued <= 1))
                    throw nb::value_error(
                        fmt::format("continued must be above 0 and at most 1, not {}", continued)
                            .c_str());
                new (self) F{.hit = hit,
                             .next_event = next_event,
                             .connect = connect,
                             .splat = splat,
                             .continued = continued};
            },
            nb::kw_only(), "hit"_a = 0.0f, "next_event"_a = 0.0f, "connect"_a = 0.0f,
            "splat"_a = 0.0f, "continued"_a = 1.0f)
        .def_ro("hit", &F::hit,
                "Samples of C(0,t), the eye path hits an emitter; a number for each eye path.")
        .def_ro("next_event", &F::next_event,
                "Samples of C(1,t), a point sampled on an emitter; a number for each eye path.")
        .def_ro("connect", &F::connect,
                "Samples of C(s,t), connections of two vertices; a number for each eye path.")
        .def_ro("splat", &F::splat,
                "Samples of C(s,1), connections to the lens: the number of light paths.")
        .def_ro("hit_lens", &F::hit_lens,
                "Samples of C(s,0), hits of a finite lens: the number of light paths.")
        .def_ro("merge", &F::merge,
                "Samples of M(s,t), merges of near vertices: the number of light paths.")
        .def_ro("gather", &F::gather, "Samples of U(s,t), gathers: the number of light paths.")
        .def_ro("continued", &F::continued,
                "Probability, above 0 and at most 1, with which eye walks continue past the first "
                "vertex where they choose a direction at random.")
        .def("__repr__", [](const F& c) {
            return fmt::format("Counts(hit={}, next_event={}, connect={}, splat={}{})", c.hit,
                               c.next_event, c.connect, c.splat,
                               c.continued < 1 ? fmt::format(", continued={}", c.continued) : "");
        });
}

}  // namespace

const char* name_of(Strategy strategy) {
    for (const auto& [name, value] : kStrategies)
        if (value == strategy) return name;
    return "";
}

void bind_techniques(nb::module_& m) {
    using namespace nb::literals;
    bind_counts(m);
    nb::class_<Technique>(
        m, "Technique",
        "A way to make a path: from s vertices of a light path and t of an eye path.")
        .def(
            "__init__",
            [](Technique* self, int s, int t, const std::optional<std::string>& strategy,
               bool drops_eye) { new (self) Technique(make_technique(s, t, strategy, drops_eye)); },
            "s"_a, "t"_a, "strategy"_a = nb::none(), "drops_eye"_a = false,
            "Without `strategy`, that of s and t: hit (s = 0), next_event (s = 1), connect, splat "
            "(t = 1) or hit_lens (t = 0).")
        .def_ro("s", &Technique::s, "Number of vertices of the light path.")
        .def_ro("t", &Technique::t, "Number of vertices of the eye path.")
        .def_prop_ro(
            "strategy", [](const Technique& q) { return std::string(name_of(q.strategy)); },
            "The name: hit, next_event, connect, splat, hit_lens, merge, gather or specular.")
        .def_prop_ro(
            "edges", [](const Technique& q) { return q.vertices() - 1; },
            "Number of edges of the whole path.")
        .def("__eq__", [](const Technique& a, const Technique& b) { return a == b; })
        .def("__hash__",
             [](const Technique& q) {
                 return int64_t(q.s) * 8191 + int64_t(q.t) * 31 + int64_t(q.strategy);
             })
        .def("__repr__", [](const Technique& q) {
            return fmt::format("Technique({}, {}, \"{}\")", q.s, q.t, name_of(q.strategy));
        });

    nb::class_<PathPdfs>(m, "PathPdfs",
                         "Densities of the vertices of a whole path, from both sides.")
        .def_prop_ro(
            "light", [](const PathPdfs& p) { return vector_array(p.light); },
            nb::rv_policy::automatic,
            "Density of each vertex as sampled from the light's side, per unit area, shape "
            "(n,); of x_0 the emitter's.")
        .def_prop_ro(
            "eye", [](const PathPdfs& p) { return vector_array(p.eye); }, nb::rv_policy::automatic,
            "Density of each vertex as sampled from the eye's side, per unit area, shape (n,).")
        .def_ro("next_event", &PathPdfs::next_event,
                "Density of x_0 as a next event samples it from x_1, per unit area.")
        .def(
            "density", &PathPdfs::density, "technique"_a,
            "Density with which the technique samples the path, the product over its vertices, per "
            "unit area for each; 0 where it cannot.")
        .def("sampled", &PathPdfs::sampled, "technique"_a, "counts"_a,
             "Number of samples times density, n p.")
        .def("__len__", &PathPdfs::vertices);

    m.def("mis_weight", &mis_weight, "pdfs"_a, "technique"_a, "counts"_a);
}

}  // namespace etendue::python
