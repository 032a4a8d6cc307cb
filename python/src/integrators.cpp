// Integrators: their names, and those written in Python.

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "pathspace/sample_context.h"
#include "render/render_request.h"
#include "sub_paths.h"

namespace etendue::python {
namespace {

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
        work_->stats.time_factor = 0;
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
        Background::calling_objects([&] { object_->attr("sample")(sample); });
    }
    TechniqueCounts counts(const Scene&, uint64_t light_paths) const override {
        const nb::gil_scoped_acquire gil;
        return Background::calling_objects(
            [&] { return nb::cast<TechniqueCounts>(object_->attr("counts")(light_paths)); });
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

struct PythonMaker {
    std::shared_ptr<nb::object> object;

    std::unique_ptr<Integrator> operator()(const std::map<std::string, std::string>& params) const {
        const auto depth = params.find("max_depth");
        const int max_depth = depth == params.end() ? kNoRoulette : std::stoi(depth->second);
        return std::make_unique<PythonIntegrator>(object, max_depth > 0 ? max_depth : kNoRoulette);
    }
};

IntegratorSpec python_spec(nb::handle integrator) {
    IntegratorSpec spec;
    spec.name = nb::cast<std::string>(integrator.attr("name"));
    spec.make = PythonMaker{shared(nb::borrow(integrator))};
    return spec;
}
}  // namespace

nb::object* python_integrator(const IntegratorSpec& spec) {
    const auto* maker = spec.make.target<PythonMaker>();
    return maker ? maker->object.get() : nullptr;
}

IntegratorSpec to_spec(const Scene& scene, nb::handle integrator) {
    if (nb::isinstance<nb::str>(integrator))
        return choose_integrator(scene, nb::cast<std::string>(integrator));
    if (nb::isinstance<nb::dict>(integrator)) {
        const auto text = nb::module_::import_("etendue._method").attr("text_of")(integrator);
        return choose_integrator(scene, nb::cast<std::string>(text));
    }
    if (nb::hasattr(integrator, "sample") && nb::hasattr(integrator, "counts") &&
        nb::hasattr(integrator, "traces_light_paths"))
        return python_spec(integrator);
    throw nb::type_error(
        "an integrator is a text such as \"bdpt:max_depth=8\", a dict such as "
        "{\"type\": \"bdpt\", \"max_depth\": 8}, or an object of a class derived from "
        "etendue.Integrator");
}

void bind_integrators(nb::module_& m) {
    using namespace nb::literals;
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
        "check_integrator",
        [](const std::string& text) { make_integrator(IntegratorSpec::parse(text)); }, "text"_a);
    m.def(
        "counts",
        [](const ScenePtr& scene, nb::handle integrator) {
            const auto made = make_integrator(to_spec(scene->scene, integrator));
            return made->counts(scene->scene, made->light_paths(scene->scene));
        },
        "scene"_a, "integrator"_a);
}

}  // namespace etendue::python
