// The path space: vertices, sub-paths, joins, densities and weights; and integrators written in Python.

#include <cstring>

#include <fmt/format.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "bindings.h"
#include "math/hash.h"
#include "pathspace/path_pdfs.h"
#include "pathspace/sample_context.h"
#include "render/render_request.h"
#include "render/renderer.h"
#include "values.h"

namespace etendue::python {
namespace {

constexpr int kNoRoulette = 1 << 20;

/// Longer walks end. No path of a scene needs more, and a closed room of mirrors would never end.
constexpr int kMostVertices = 1024;

constexpr std::pair<const char*, Strategy> kStrategies[] = {
    {"hit", Strategy::Hit},          {"next_event", Strategy::NextEvent},
    {"connect", Strategy::Connect},  {"splat", Strategy::Splat},
    {"hit_lens", Strategy::HitLens}, {"merge", Strategy::Merge},
    {"gather", Strategy::Gather}};

const char* name_of(Strategy strategy) {
    for (const auto& [name, value] : kStrategies)
        if (value == strategy) return name;
    return "";
}

Technique make_technique(int s, int t, const std::optional<std::string>& strategy, bool drops_eye) {
    if (s < 0 || t < 0 || s + t < 2) throw nb::value_error("s and t count the vertices of a path");
    if (!strategy) return connection_technique(s, t);
    for (const auto& [name, value] : kStrategies)
        if (*strategy == name) return {value, s, t, drops_eye};
    throw nb::value_error("strategy must be hit, next_event, connect, splat, hit_lens, merge or "
                          "gather");
}

/// A sub-path with what it needs. Those of an integrator's sample are only valid during that sample.
struct Path {
    Path(ScenePtr s, const TechniqueCounts& c) : scene(std::move(s)), counts(c), own(), at(&own) {}
    Path(SubPath& sub_path, const TechniqueCounts& c) : counts(c), own(), at(&sub_path) {}

    const SubPath& sub_path() const {
        if (!at)
            throw std::runtime_error("this sub-path belonged to a sample that has ended; use its "
                                     "arrays within sample()");
        return *at;
    }

    ScenePtr scene;  ///< Kept alive; empty within samples.
    TechniqueCounts counts;
    SubPath own;
    SubPath* at;
};
using PathPtr = std::shared_ptr<Path>;

/// A vertex of a sub-path, which it keeps alive, or one of its own.
struct VertexHandle {
    PathPtr path;
    int index = 0;
    std::shared_ptr<Vertex> own;
    std::shared_ptr<ComponentArena> arena;  ///< Of the BSDF of `own`.
    ScenePtr scene;

    const Vertex& vertex() const {
        if (own) return *own;
        const SubPath& p = path->sub_path();
        if (index >= p.size()) throw std::runtime_error("the sub-path has been replaced");
        return p[index];
    }
};

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

WalkOptions walk_options(std::optional<int> max_vertices, std::optional<int> rr_depth) {
    if (max_vertices && *max_vertices < 1) throw nb::value_error("max_vertices must be at least 1");
    if (rr_depth && *rr_depth < 1) throw nb::value_error("rr_depth must be at least 1");
    return {std::min(max_vertices.value_or(kMostVertices), kMostVertices),
            rr_depth.value_or(kNoRoulette)};
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
        trace_eye_path(walk, scene->film, pixel_index(scene->scene, *pixel), sampler, out->own);
    else
        trace_light_path(walk, sampler, out->own);
    return out;
}

/// A join with the sub-paths it was made of, and its contribution after the shadow ray.
struct JoinHandle {
    Join join;
    Rgb contribution;
    PathPtr y, z;
    ScenePtr scene;
};

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

/// Whether the joins of s and t vertices are made of a light sub-path, and of an eye sub-path beyond the lens.
bool uses_light_path(int s, int t) {
    return s >= 2 || (s == 1 && t == 1);
}
bool uses_eye_path(int t) {
    return t >= 2;
}

/// All joins of y_{s-1} and z_{t-1} with a contribution, after their shadow rays.
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

// -- Integrators in Python

/// One sample of an integrator in Python; valid while its sample() runs.
class Sample {
public:
    Sample(const SampleContext& context, Workspace& work, const TechniqueCounts& counts,
           int max_depth)
        : scene_(SceneHandle::of(context.scene)), context_(&context), work_(&work), counts_(counts),
          max_depth_(max_depth) {}

    void expire() {
        context_ = nullptr;
        for (const PathPtr& p : {y_, z_})
            if (p) p->at = nullptr;
    }
    std::pair<int, int> pixel() const {
        const int w = context().scene.film().crop_width;
        const uint64_t pixel = context().film.pixel_of(context().index);
        return {int(pixel % uint64_t(w)), int(pixel / uint64_t(w))};
    }
    PathPtr eye_path(std::optional<int> max_vertices, std::optional<int> rr_depth) {
        const WalkContext walk{context().scene, counts_, work_->stats,
                               walk_options(max_vertices, rr_depth)};
        renew(z_, work_->z);
        trace_eye_path(walk, context().film, context().index, context().sampler, work_->z);
        return z_;
    }
    PathPtr light_path(std::optional<int> max_vertices, std::optional<int> rr_depth) {
        if (context().light_paths == 0)
            throw std::runtime_error("this integrator traces no light paths: set "
                                     "traces_light_paths = True in its class");
        const WalkContext walk{context().scene, counts_, work_->stats,
                               walk_options(max_vertices, rr_depth)};
        renew(y_, work_->y);
        trace_light_path(walk, context().sampler, work_->y);
        return y_;
    }
    std::vector<JoinHandle> join(int s, int t) {
        const SampleContext& c = context();
        return joins(scene_, y_, s, z_, t, c.sampler, counts_, work_->stats);
    }
    double uniform() {
        context().sampler.seek(Stream::Auxiliary, numbers_++);
        return context().sampler.next_1d_unstructured();
    }
    void add(const JoinHandle& j, std::optional<float> mis_weight, double factor) {
        const SampleContext& c = context();
        // The sinks look at the sub-paths of this sample, as they are now.
        const Technique& q = j.join.technique;
        if ((uses_light_path(q.s, q.t) && j.y != y_) || (uses_eye_path(q.t) && j.z != z_))
            throw nb::value_error(
                "this join belongs to another sample, or one of its sub-paths has "
                "been replaced; add joins in the sample that made them");
        if (j.join.technique.vertices() - 1 > max_depth_) return;
        Join join = j.join;
        if (mis_weight) join.mis_weight = *mis_weight;
        c.sink.add(join, j.contribution * float(factor));
    }

private:
    const SampleContext& context() const {
        if (!context_) throw std::runtime_error("this sample has ended");
        return *context_;
    }
    void renew(PathPtr& path, SubPath& sub_path) {
        if (path) path->at = nullptr;
        path = std::make_shared<Path>(sub_path, counts_);
        work_->stats.is_timed = false;
    }

    ScenePtr scene_;
    const SampleContext* context_;
    Workspace* work_;
    TechniqueCounts counts_;
    int max_depth_;
    PathPtr y_, z_;
    uint64_t numbers_ = 0;
};

/// The last owner may be a thread without the GIL.
std::shared_ptr<nb::object> shared(nb::object object) {
    return {new nb::object(std::move(object)), [](nb::object* o) {
                const nb::gil_scoped_acquire gil;
                delete o;
            }};
}

/// Calls an object of Python, whose methods are those of etendue.Integrator.
class PythonIntegrator final : public Integrator {
public:
    PythonIntegrator(std::shared_ptr<nb::object> object, int max_depth)
        : object_(std::move(object)), max_depth_(max_depth) {
        const nb::gil_scoped_acquire gil;
        before_ = shared(helpers().attr("attributes_of")(*object_));
        traces_light_paths_ = nb::cast<bool>(object_->attr("traces_light_paths"));
        const auto name = nb::cast<std::string>(object_->attr("estimator"));
        for (const Estimator e : {Estimator::Unbiased, Estimator::Consistent, Estimator::Biased})
            if (name == to_string(e)) {
                estimator_ = e;
                return;
            }
        throw nb::value_error("estimator must be \"unbiased\", \"consistent\" or \"biased\"");
    }

    void trace(const PassContext& pass) override { counts_ = counts(pass.scene, pass.light_paths); }
    void sample(const SampleContext& context, Workspace& work) const override {
        const nb::gil_scoped_acquire gil;
        auto sample = std::make_shared<Sample>(context, work, counts_, max_depth_);
        struct Expiry {
            Sample& of;
            ~Expiry() { of.expire(); }
        } expiry{*sample};
        object_->attr("sample")(sample);
    }
    TechniqueCounts counts(const Scene&, uint64_t light_paths) const override {
        const nb::gil_scoped_acquire gil;
        return nb::cast<TechniqueCounts>(object_->attr("counts")(light_paths));
    }
    uint64_t light_paths(const Scene& scene) const override {
        return traces_light_paths_ ? scene.film().pixel_count() : 0;
    }
    Estimator estimator() const override { return estimator_; }
    void save(LearnedState& to) const override {
        const nb::gil_scoped_acquire gil;
        nb::bytes state("", 0);
        if (nb::hasattr(*object_, "save")) {
            state = nb::cast<nb::bytes>(object_->attr("save")());
        } else if (const auto changed = nb::cast<std::vector<std::string>>(
                       helpers().attr("changed_attributes")(*object_, *before_));
                   !changed.empty()) {
            throw std::runtime_error(fmt::format(
                "{} cannot be saved: rendering has changed {}, and it has no methods save() and "
                "load()",
                nb::cast<std::string>(object_->attr("name")), fmt::join(changed, ", ")));
        }
        const auto* begin = reinterpret_cast<const std::byte*>(state.c_str());
        to.put(std::vector<std::byte>(begin, begin + state.size()));
    }
    void load(LearnedState& from) override {
        std::vector<std::byte> state;
        from.get(state);
        const nb::gil_scoped_acquire gil;
        if (nb::hasattr(*object_, "load"))
            object_->attr("load")(
                nb::bytes(reinterpret_cast<const char*>(state.data()), state.size()));
    }

private:
    static nb::module_ helpers() { return nb::module_::import_("etendue._integrator"); }

    std::shared_ptr<nb::object> object_,
        before_;  ///< The object; its attributes before the first pass.
    int max_depth_;
    bool traces_light_paths_ = false;
    Estimator estimator_ = Estimator::Unbiased;
    TechniqueCounts counts_;
};

IntegratorSpec python_spec(nb::handle integrator) {
    IntegratorSpec spec;
    spec.name = nb::cast<std::string>(integrator.attr("name"));
    const auto object = shared(nb::borrow(integrator));
    spec.make = [object](const std::map<std::string, std::string>& params) {
        const auto depth = params.find("max_depth");
        const int max_depth = depth == params.end() ? kNoRoulette : std::stoi(depth->second);
        return std::make_unique<PythonIntegrator>(object, max_depth > 0 ? max_depth : kNoRoulette);
    };
    return spec;
}

// -- Paths of a rendering

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
            x.push_back(i == 0 && q.strategy == Strategy::NextEvent ? join.b.p : work.y[i].p);
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
    const auto bytes = [](const void* data, size_t size) {
        return nb::bytes(static_cast<const char*>(data), size);
    };
    return nb::make_tuple(
        bytes(recorder.records.data(), recorder.records.size() * sizeof(PathRecord)),
        bytes(recorder.points.data(), recorder.points.size() * sizeof(float)));
}

template <class T>
nb::ndarray<nb::numpy, T> vector_array(const std::vector<T>& values) {
    auto* kept = new std::vector<T>(values);
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::ndarray<nb::numpy, T>(kept->data(), {kept->size()}, owner);
}

}  // namespace

IntegratorSpec to_spec(const Scene& scene, nb::handle integrator) {
    if (nb::isinstance<nb::str>(integrator))
        return choose_integrator(scene, nb::cast<std::string>(integrator));
    if (nb::hasattr(integrator, "sample") && nb::hasattr(integrator, "counts") &&
        nb::hasattr(integrator, "traces_light_paths"))
        return python_spec(integrator);
    throw nb::type_error("an integrator is a text such as \"bdpt:max_depth=8\", or an object of a "
                         "class derived from etendue.Integrator");
}

void bind_core(nb::module_& m) {
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
            "The name: hit, next_event, connect, splat, hit_lens, merge or gather.")
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

    nb::class_<Sample>(
        m, "Sample",
        "What an integrator has for one sample: the pixel, random numbers, walks, joins, "
        "and the film. Only valid during the call of sample().")
        .def_prop_ro("pixel", &Sample::pixel,
                     "Column and row of the eye path's pixel; of the nearest pixel for an eye path "
                     "beside the image, whose filter reaches into it.")
        .def("eye_path", &Sample::eye_path, "max_vertices"_a = nb::none(),
             "rr_depth"_a = nb::none(),
             "Walks from the lens through the pixel: z_0 on the lens, z_1 the first surface, ... "
             "rr_depth: index of the first vertex with Russian roulette; without it there is none.")
        .def("light_path", &Sample::light_path, "max_vertices"_a = nb::none(),
             "rr_depth"_a = nb::none(),
             "Walks from an emitter: y_0 on it, y_1 the first surface, ... One in each sample, "
             "where "
             "the class has traces_light_paths = True.")
        .def("join", &Sample::join, "s"_a, "t"_a,
             "The paths that s light vertices and t eye vertices of the last walks make, after "
             "their "
             "shadow rays: none, one, or for s = 0 several. s = 1 samples a new point on an "
             "emitter.")
        .def("add", &Sample::add, "join"_a, "mis_weight"_a = nb::none(), "factor"_a = 1.0,
             "Adds a path to the film: its contribution times its MIS weight, or times the given "
             "one, "
             "times factor.")
        .def("uniform", &Sample::uniform, "A random number in [0, 1).");

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
    m.def("mis_weight", &mis_weight, "pdfs"_a, "technique"_a, "counts"_a);
    m.def(
        "counts",
        [](const ScenePtr& scene, nb::handle integrator) {
            const auto made = make_integrator(to_spec(scene->scene, integrator));
            return made->counts(scene->scene, made->light_paths(scene->scene));
        },
        "scene"_a, "integrator"_a);
    m.def("sample_paths", &sample_paths, "scene"_a, "n"_a, "integrator"_a, "seed"_a,
          "most_vertices"_a, "sampler"_a);
}

}  // namespace etendue::python
