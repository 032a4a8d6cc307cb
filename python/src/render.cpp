// Rendering on a thread of its own, and what it leaves.

#include <atomic>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <nlohmann/json.hpp>

#include "bindings.h"
#include "image/denoiser.h"
#include "image/image_io.h"
#include "math/statistics.h"
#include "render/aov.h"
#include "render/merging.h"
#include "render/method_choice.h"
#include "render/render_report.h"
#include "render/render_request.h"
#include "render/renderer.h"
#include "render/warnings.h"
#include "system/output_file.h"
#include "values.h"

namespace etendue::python {

namespace {

const char* technique_kind(const Technique& q) {
    return q.strategy == Strategy::Connect && q.s == 1 ? "stored" : name_of(q.strategy);
}

RenderSettings settings_for(const Scene& scene, nb::handle integrator, RenderRequest request) {
    check_above_0("spp, time and error", {request.spp, request.seconds, request.error});
    checked_threads(request.threads);
    checked("techniques", request.technique_depth, 0, 64);
    set_default_limit(request, scene);
    RenderSettings s = settings_of(request, to_spec(scene, integrator));
    // Objects of Python work on one thread.
    if (s.integrator.make) s.threads = 1;
    return s;
}

std::string python_identity(nb::handle integrator) {
    return nb::cast<std::string>(
        nb::module_::import_("etendue._integrator").attr("identity")(integrator));
}

/// Pilots take time, and Ctrl-C ends them. `earlier`: the choice of the rendering that goes on, or empty.
RenderSettings with_method(const Scene& scene, const RenderSettings& settings,
                           const std::string& earlier) {
    if (!earlier.empty()) {
        const MethodChoice choice = MethodChoice::from_json(earlier);
        RenderSettings chosen = with_chosen_method(settings, choice);
        const IntegratorSpec same = choose_integrator(scene, choice.chosen);
        if (!chosen.choice && chosen.integrator.to_string() == same.to_string())
            chosen.choice = std::make_shared<const MethodChoice>(choice);
        return chosen;
    }
    if (!is_chosen_by_pilots(settings.integrator)) return settings;
    use_threads();
    RenderSettings chosen;
    Background background;
    try {
        background.run([&] { chosen = with_chosen_method(scene, settings, background.drop); },
                       [] {});
    } catch (const PassDropped&) {
        // What interrupted them follows.
    }
    if (background.interrupted) {
        PyErr_SetNone(PyExc_KeyboardInterrupt);
        throw nb::python_error();
    }
    return chosen;
}

/// Trial renderings of the integrator take time.
Renderer make_renderer(const Scene& scene, const RenderSettings& settings) {
    use_threads();
    const nb::gil_scoped_release no_gil;
    return Renderer(scene, settings);
}

/// 95 % half width of every pixel's confidence interval.
std::vector<Rgb> half_width_of(const Film& film) {
    std::vector<Rgb> out = film.variance();
    // Where passes depend on each other, groups of them are the independent values.
    const int groups = film.groups();
    const double samples = groups > 0 ? groups / 2 + 1 : double(film.passes());
    const bool is_known = samples >= 2 && film.passes() >= uint64_t(std::max(groups, 2));
    const double t =
        is_known ? student_quantile(0.05, samples - 1) : std::numeric_limits<double>::quiet_NaN();
    for (Rgb& c : out)
        for (int i = 0; i < 3; ++i) c[i] = float(t * std::sqrt(double(c[i])));
    return out;
}

/// A renderer with its scene.
class Rendering {
public:
    /// `earlier`: as in with_method().
    Rendering(ScenePtr scene, nb::handle integrator, const RenderRequest& request,
              const std::string& earlier)
        : scene_(std::move(scene)),
          settings_(with_method(scene_->scene, settings_for(scene_->scene, integrator, request),
                                earlier)),
          python_integrator_(settings_.integrator.make ? python_identity(integrator) : ""),
          renderer_(make_renderer(scene_->scene, settings_)), conditions_(conditions()) {}

    /// `tick()` is called every 50 ms, `callback()` between passes, at least `interval` seconds apart; it returns False to
    /// stop.
    std::string run(nb::object tick, nb::object callback, double interval) {
        use_threads();
        Background background;
        struct Running {
            explicit Running(std::atomic<bool>& flag) : flag_(flag) { flag_ = true; }
            ~Running() { flag_ = false; }
            std::atomic<bool>& flag_;
        } const running(is_running_);
        std::atomic<bool> asked_to_stop{false};
        double last = -std::numeric_limits<double>::infinity();
        const std::function<void()> call = [&] {
            // The pass is over, and the next one waits for the callback.
            struct Reading {
                explicit Reading(std::atomic<std::thread::id>& reader) : reader_(reader) {
                    reader_ = std::this_thread::get_id();
                }
                ~Reading() { reader_ = std::thread::id(); }
                std::atomic<std::thread::id>& reader_;
            } const reading(reader_);
            const nb::object answer = callback();
            if (answer.is(nb::bool_(false))) asked_to_stop = true;
        };
        RecentError recent;
        const auto progress = [&](const Progress& p) {
            const bool calls = !callback.is_none() && p.seconds - last >= interval;
            std::optional<double> relative_error;
            try {
                log_.add(p.seconds, renderer_.stats().pairs);
                // Callbacks may stop the rendering by its error, and are told that of this pass.
                const ErrorEstimate error = calls ? p.error() : recent.update(p);
                if (error.valid) relative_error = error.relative_rms;
                const std::scoped_lock lock(mutex_);
                note(p.passes, p.seconds, error);
            } catch (const std::exception&) {
                // The pass is made, though some of its figures may be missing.
            }
            {
                const std::scoped_lock lock(mutex_);
                now_ = Now{p.passes, p.seconds, p.fraction, p.rays_per_second, relative_error};
            }
            if (!calls) return;
            last = p.seconds;
            background.call(call);
        };
        StopReason reason = StopReason::Samples;
        const auto render = [&] {
            reason = renderer_.run(
                [&](const Progress& p) {
                    progress(p);
                    if (asked_to_stop) background.stop = true;
                },
                background.stop, background.drop);
        };
        try {
            background.run(render, [&] {
                if (is_asked_to_end_) background.stop = background.drop = true;
                if (!tick.is_none()) tick();
            });
        } catch (...) {
            stopped_by_ = "failure";
            place_of_failure_ = background.task_failed ? renderer_.place_of_failure() : "";
            throw;
        }
        stopped_by_ = to_string(reason);
        if (reason == StopReason::Interrupted && !background.interrupted) {
            if (asked_to_stop) stopped_by_ = "callback";
            if (is_asked_to_end_) stopped_by_ = "stopped";
        }
        return stopped_by_;
    }
    /// Ends run(), which discards the current pass; or the next run(), if none runs. Any thread may call it.
    void stop() { is_asked_to_end_ = true; }

    const SceneHandle& scene() const { return *scene_; }
    ScenePtr scene_pointer() const { return scene_; }
    int width() const { return scene_->scene.film().crop_width; }
    int height() const { return scene_->scene.film().crop_height; }
    /// The film and all else of the renderer. Passes change them, so that they can be read in callbacks and after the
    /// rendering only.
    const Renderer& renderer() const {
        if (!is_readable())
            throw std::runtime_error("the rendering is running: its images and statistics can be "
                                     "read in callbacks, and when it has ended");
        return renderer_;
    }
    const Film& film() const { return renderer().film(); }
    /// Those of the film; where it cannot be read, as of now().
    uint64_t passes() const {
        if (is_readable()) return renderer_.film().passes();
        const auto last = now();
        return last ? std::get<0>(*last) : 0;
    }
    /// As Renderer::place_of_failure(). Empty if what run() has thrown is an exception of the caller, such as one of the
    /// callback or of a signal handler.
    std::string place_of_failure() const { return place_of_failure_; }
    /// Whether the film may still change.
    bool is_running() const { return is_running_; }

    /// Passes, seconds, fraction, rays a second, relative error; as of the last finished pass, while it runs.
    using Now = std::tuple<uint64_t, double, std::optional<double>, double, std::optional<double>>;
    std::optional<Now> now() const {
        const std::scoped_lock lock(mutex_);
        return now_;
    }

    /// Passes, seconds and relative error, at numbers of passes of about equal ratio, and of the last one whose error is known.
    std::vector<std::tuple<uint64_t, double, double>> errors() const {
        const std::scoped_lock lock(mutex_);
        return errors_;
    }

    nlohmann::json report() const {
        return to_json(renderer(), scene_->scene, settings_, stopped_by_, log_);
    }
    void save(const std::string& file, const std::vector<std::string>& names) const {
        check_image_extension(file);
        use_threads();
        const std::vector<AovImage> layers = aovs(names);
        const bool has_variance = std::find(names.begin(), names.end(), "variance") != names.end();
        write_image(file, image_rows(film(), layers, has_variance, report()));
    }
    Image denoised(const std::string& library) const {
        use_threads();
        const std::vector<AovImage> layers = aovs({"denoise_albedo", "denoise_normal"});
        return Denoiser(library).denoise(to_image(image_rows(film(), layers, false, report())),
                                         settings_.threads);
    }
    bool spreads() const { return film().spreads(); }
    void save_checkpoint(const std::string& file) const {
        written_checkpoint(file, renderer(), scene_->scene, conditions_, settings_, log_)->commit();
    }
    /// Before the first pass.
    void resume(const std::string& file) {
        use_threads();
        CheckpointFile checkpoint(file);
        checkpoint.resume(renderer_, conditions_, log_);
        const std::scoped_lock lock(mutex_);
        now_ = Now{renderer_.film().passes(), renderer_.seconds(), {}, 0, {}};
    }
    std::string partial() const {
        return partial_result(renderer(), scene_->scene, conditions_, settings_, log_);
    }
    std::vector<AovImage> aovs(const std::vector<std::string>& names) const {
        return render_aovs(scene_->scene, names, kAovSamples, settings_.seed, settings_.threads);
    }
    const RenderSettings& settings() const { return settings_; }

private:
    bool is_readable() const { return !is_running_ || reader_ == std::this_thread::get_id(); }
    Conditions conditions() const {
        Conditions all =
            conditions_of(renderer_, scene_->scene,
                          {scene_->fingerprint, scene_->lenient, scene_->watertight}, settings_);
        if (!python_integrator_.empty())
            for (auto& [name, value] : all)
                if (name == kIntegratorCondition) value = python_integrator_;
        return all;
    }

    /// Keeps the error for errors(); with `mutex_`.
    void note(uint64_t passes, double seconds, const ErrorEstimate& error) {
        const size_t n = errors_.size();
        if (!error.valid || (n > 0 && std::get<2>(errors_.back()) == error.relative_rms)) return;
        constexpr double kRatio = 1.1;
        if (n > 1 &&
            double(std::get<0>(errors_[n - 1])) < kRatio * double(std::get<0>(errors_[n - 2])))
            errors_.pop_back();
        errors_.emplace_back(passes, seconds, error.relative_rms);
    }

    ScenePtr scene_;
    RenderSettings settings_;
    std::string python_integrator_;  ///< What decides the samples of an integrator in Python.
    Renderer renderer_;
    Conditions conditions_;  ///< At the start: files may change later.
    mutable std::mutex mutex_;
    std::optional<Now> now_;
    std::vector<std::tuple<uint64_t, double, double>> errors_;
    std::atomic<bool> is_running_{false}, is_asked_to_end_{false};
    std::atomic<std::thread::id> reader_{};  ///< The thread of a callback that runs.
    PassLog log_;
    std::string stopped_by_;
    std::string place_of_failure_;
};
using RenderingPtr = std::shared_ptr<Rendering>;

// An integrator in Python may refer to its rendering, for example by an exception that it keeps, whose traceback has the
// frames of render(). Python's collector sees such cycles.

int visit_integrator(PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    if (!nb::inst_ready(self)) return 0;
    if (const nb::object* o =
            python_integrator(nb::inst_ptr<Rendering>(self)->settings().integrator))
        Py_VISIT(o->ptr());
    return 0;
}

int clear_integrator(PyObject* self) {
    if (!nb::inst_ready(self)) return 0;
    if (nb::object* o = python_integrator(nb::inst_ptr<Rendering>(self)->settings().integrator))
        *o = nb::none();
    return 0;
}

PyType_Slot kRenderingSlots[] = {{Py_tp_traverse, reinterpret_cast<void*>(visit_integrator)},
                                 {Py_tp_clear, reinterpret_cast<void*>(clear_integrator)},
                                 {0, nullptr}};

constexpr const char* kTechniquesSignature =
    "def techniques(self) -> list[tuple[int, int, str, numpy.typing.NDArray[numpy.float32], "
    "numpy.typing.NDArray[numpy.float32]]]";

/// The images of techniques as they go to Python.
nb::list list_of(std::vector<TechniqueImages::Entry> images, const FilmGeometry& g) {
    nb::list all;
    for (auto& e : images) {
        const Technique q = e.technique;
        all.append(nb::make_tuple(q.s, q.t, technique_kind(q),
                                  to_array(std::move(e.weighted), g.crop_width, g.crop_height),
                                  to_array(std::move(e.unweighted), g.crop_width, g.crop_height)));
    }
    return all;
}

using Error = std::optional<std::tuple<double, double, double>>;
Error tuple_of(const ErrorEstimate& e) {
    if (!e.valid) return {};
    return std::tuple{e.relative_rms, e.low, e.high};
}

/// The sum of several renderings.
struct Merged {
    std::optional<Merging> of;
    RenderTotals totals;
    std::vector<std::string> files;  ///< Those of the parts that have one.

    Merged(std::vector<CheckpointFile> parts, std::vector<std::string> part_files)
        : files(std::move(part_files)) {
        of.emplace(std::move(parts));
        totals = of->totals();
    }
    void save_checkpoint(const std::string& file) const {
        for (const std::string& part : files)
            if (are_one_file(part, file))
                throw std::runtime_error(fmt::format(
                    "{} is one of the parts, which could then not go on: choose another file",
                    file));
        of->write(file, totals);
    }
    /// Without the auxiliary images, which need the scene.
    Image denoised(const std::string& library) const {
        use_threads();
        return Denoiser(library).denoise(
            to_image(image_rows(film(), {}, false, of->report(totals))));
    }
    bool spreads() const {
        return of->first().header().condition("filter mode") == to_string(FilterMode::Spread);
    }
    const Film& film() const { return *totals.film; }
    int width() const { return film().geometry().crop_width; }
    int height() const { return film().geometry().crop_height; }
};

/// A part of the film's moments, by channel.
template <class T>
using PartOfMoments = T (PixelMoments::*)[3];
template <class T>
using ReadOnlyArray = nb::ndarray<nb::numpy, const T>;

/// A view of them, which keeps its owner alive.
template <class T, class Owner>
ReadOnlyArray<T> view_of(const Owner& owner, const Film& film, PartOfMoments<T> part) {
    const size_t w = size_t(film.geometry().crop_width), h = size_t(film.geometry().crop_height);
    constexpr int64_t kStride = sizeof(PixelMoments) / sizeof(T);
    return ReadOnlyArray<T>(film.moments().front().*part, {h, w, 3}, nb::cast(owner),
                            {int64_t(w) * kStride, kStride, 1});
}

/// After the rendering, such a view. The film of a running one changes when the callback has ended, so that callbacks get
/// copies.
template <class T>
ReadOnlyArray<T> view_or_copy(const RenderingPtr& r, PartOfMoments<T> part) {
    if (!r->is_running()) return view_of(r, r->film(), part);
    const auto moments = r->film().moments();
    auto copy = std::make_unique<std::vector<T>>();
    copy->reserve(3 * moments.size());
    for (const PixelMoments& m : moments)
        for (const T v : m.*part) copy->push_back(v);
    const T* data = copy->data();
    nb::capsule owner(copy.release(),
                      [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return ReadOnlyArray<T>(data, {size_t(r->height()), size_t(r->width()), 3}, owner);
}

/// An image of the film, which is computed without the GIL.
template <class R, class Make>
FloatArray image_of(const R& r, const Make& make) {
    std::vector<Rgb> pixels;
    {
        const nb::gil_scoped_release no_gil;
        pixels = make();
    }
    return to_array(std::move(pixels), r.width(), r.height());
}

/// What et.merge() makes of files and of partial results.
std::shared_ptr<Merged> merge(const nb::list& parts) {
    std::vector<CheckpointFile> files;
    std::vector<std::string> names;
    for (const nb::handle part : parts) {
        if (nb::isinstance<nb::bytes>(part)) {
            const auto bytes = nb::cast<nb::bytes>(part);
            files.emplace_back(SectionReader(std::string(bytes.c_str(), bytes.size()),
                                             fmt::format("part {}", files.size() + 1)));
        } else {
            const auto name = nb::cast<std::string>(part);
            files.emplace_back(name);
            // The working folder may be another one when the sum is saved.
            names.push_back(std::filesystem::absolute(name).string());
        }
    }
    if (files.empty()) throw nb::value_error("there are no parts to merge");
    use_threads();
    const nb::gil_scoped_release no_gil;
    return std::make_shared<Merged>(std::move(files), std::move(names));
}

/// The methods of renderings and of their sums that denoise.
template <class R>
void bind_denoising(nb::class_<R>& c) {
    using namespace nb::literals;
    c.def_prop_ro("spreads", &R::spreads)
        .def(
            "denoised",
            [](const R& r, const std::string& library) {
                return image_of(r, [&] { return rgb_pixels(r.denoised(library)); });
            },
            "library"_a)
        .def(
            "save_denoised",
            [](const R& r, const std::string& file, const std::string& library) {
                check_image_extension(file);
                write_image(file, r.denoised(library));
            },
            nb::call_guard<nb::gil_scoped_release>(), "file"_a, "library"_a);
}

void bind_merging(nb::module_& m) {
    using namespace nb::literals;
    nb::class_<Merged> merged(m, "Merged");
    bind_denoising(merged);
    merged.def_prop_ro("passes", [](const Merged& r) { return r.film().passes(); })
        .def_prop_ro("seconds", [](const Merged& r) { return r.totals.seconds; })
        .def_prop_ro("estimator", [](const Merged& r) { return r.of->first().header().estimator; })
        .def_prop_ro("integrator",
                     [](const Merged& r) { return r.of->first().header().integrator; })
        .def_prop_ro("warnings", [](const Merged& r) { return warnings(r.totals.stats); })
        .def("merge_warnings", [](const Merged& r) { return r.of->warnings(); })
        .def("error",
             [](const Merged& r) {
                 const nb::gil_scoped_release no_gil;
                 return tuple_of(r.film().error());
             })
        .def("image", [](const Merged& r) { return image_of(r, [&] { return r.film().image(); }); })
        .def("variance",
             [](const Merged& r) { return image_of(r, [&] { return r.film().variance(); }); })
        .def("half_width",
             [](const Merged& r) { return image_of(r, [&] { return half_width_of(r.film()); }); })
        .def("sums",
             [](const std::shared_ptr<Merged>& r) {
                 return view_of(r, r->film(), &PixelMoments::sum);
             })
        .def("deviations",
             [](const std::shared_ptr<Merged>& r) {
                 return view_of(r, r->film(), &PixelMoments::deviation);
             })
        .def("stats",
             [](const Merged& r) {
                 const nb::gil_scoped_release no_gil;
                 return json_text(r.of->report(r.totals));
             })
        .def(
            "techniques",
            [](const Merged& r) {
                std::vector<TechniqueImages::Entry> images;
                if (r.totals.techniques) images = r.totals.techniques->images();
                return list_of(std::move(images), r.film().geometry());
            },
            nb::sig(kTechniquesSignature))
        .def("partial",
             [](const Merged& r) {
                 const std::string bytes = r.of->bytes(r.totals);
                 return nb::bytes(bytes.data(), bytes.size());
             })
        .def(
            "save",
            [](const Merged& r, const std::string& file, const std::vector<std::string>&) {
                check_image_extension(file);
                write_image(file, image_rows(r.film(), {}, false, r.of->report(r.totals)));
            },
            nb::call_guard<nb::gil_scoped_release>(), "file"_a, "aovs"_a)
        .def("save_checkpoint", &Merged::save_checkpoint, nb::call_guard<nb::gil_scoped_release>(),
             "file"_a);
    m.def("merge", &merge, "parts"_a);
    m.def(
        "read_checkpoint",
        [](const std::string& file) {
            const CheckpointFile checkpoint(file);
            const CheckpointHeader& c = checkpoint.header();
            const PassRange& range = c.ranges.front();
            nb::dict d;
            d["integrator"] = c.integrator;
            d["condition"] = c.condition(kIntegratorCondition);
            d["sampler"] = c.condition("sampler");
            d["filter_mode"] = c.condition("filter mode");
            d["seed"] = range.seed;
            d["first_pass"] = range.first;
            d["technique_depth"] = c.technique_depth;
            d["choice"] = c.choice;
            return d;
        },
        "file"_a);
}

}  // namespace

void bind_render(nb::module_& m) {
    using namespace nb::literals;
    using Strings = std::vector<std::string>;
    nb::class_<Rendering> rendering(m, "Rendering", nb::type_slots(kRenderingSlots));
    bind_denoising(rendering);
    rendering
        .def(
            "__init__",
            [](Rendering* self, ScenePtr scene, nb::handle integrator, std::optional<uint64_t> spp,
               std::optional<double> time, std::optional<double> error, uint64_t seed,
               const std::string& sampler, const std::string& filter, int threads,
               int technique_depth, uint64_t first_pass, const std::string& choice) {
                RenderRequest r;
                r.spp = spp;
                r.seconds = time;
                r.error = error;
                r.seed = seed;
                r.sampler = sampler_named(sampler, "sampler");
                r.filter_mode = filter_mode_named(filter, "filter_mode");
                r.threads = threads;
                r.technique_depth = technique_depth;
                r.first_pass = first_pass;
                new (self) Rendering(std::move(scene), integrator, r, choice);
            },
            "scene"_a, "integrator"_a, "spp"_a.none(), "time"_a.none(), "error"_a.none(), "seed"_a,
            "sampler"_a, "filter_mode"_a, "threads"_a, "technique_depth"_a, "first_pass"_a,
            "choice"_a = "")
        .def("run", &Rendering::run, "tick"_a.none(), "callback"_a.none(), "interval"_a)
        .def("stop", &Rendering::stop)
        .def("now", &Rendering::now)
        .def_prop_ro("place_of_failure", &Rendering::place_of_failure)
        .def("errors", &Rendering::errors)
        .def_prop_ro("scene", &Rendering::scene_pointer)
        .def_prop_ro("passes", &Rendering::passes)
        .def_prop_ro("seconds", [](const Rendering& r) { return r.renderer().seconds(); })
        .def_prop_ro("estimator",
                     [](const Rendering& r) {
                         return std::string(to_string(r.renderer().integrator().estimator()));
                     })
        .def_prop_ro("integrator",
                     [](const Rendering& r) { return r.settings().integrator.to_string(); })
        .def_prop_ro("warnings", [](const Rendering& r) { return warnings(r.renderer().stats()); })
        .def_prop_ro("memory_warnings",
                     [](const Rendering& r) { return memory_warnings(r.renderer()); })
        .def("error",
             [](const Rendering& r) {
                 const nb::gil_scoped_release no_gil;
                 return tuple_of(r.renderer().error());
             })
        .def("image",
             [](const Rendering& r) { return image_of(r, [&] { return r.film().image(); }); })
        .def("variance",
             [](const Rendering& r) { return image_of(r, [&] { return r.film().variance(); }); })
        .def(
            "half_width",
            [](const Rendering& r) { return image_of(r, [&] { return half_width_of(r.film()); }); })
        .def("sums", [](const RenderingPtr& r) { return view_or_copy(r, &PixelMoments::sum); })
        .def("deviations",
             [](const RenderingPtr& r) { return view_or_copy(r, &PixelMoments::deviation); })
        .def("stats",
             [](const Rendering& r) {
                 const nb::gil_scoped_release no_gil;
                 return json_text(r.report());
             })
        .def(
            "techniques",
            [](const Rendering& r) {
                std::vector<TechniqueImages::Entry> images;
                if (const TechniqueImages* own = r.renderer().techniques()) {
                    const nb::gil_scoped_release no_gil;
                    images = own->images();
                }
                return list_of(std::move(images), r.film().geometry());
            },
            nb::sig(kTechniquesSignature))
        .def(
            "aovs",
            [](const Rendering& r, const Strings& names) {
                std::map<std::string, FloatArray> out;
                std::vector<AovImage> images;
                {
                    use_threads();
                    const nb::gil_scoped_release no_gil;
                    images = r.aovs(names);
                }
                for (AovImage& a : images)
                    out.emplace(a.name, to_array(std::move(a.pixels), r.width(), r.height()));
                return out;
            },
            "names"_a)
        .def("save_checkpoint", &Rendering::save_checkpoint,
             nb::call_guard<nb::gil_scoped_release>(), "file"_a)
        .def("resume", &Rendering::resume, nb::call_guard<nb::gil_scoped_release>(), "file"_a)
        .def("partial",
             [](const Rendering& r) {
                 std::string bytes;
                 {
                     const nb::gil_scoped_release no_gil;
                     bytes = r.partial();
                 }
                 return nb::bytes(bytes.data(), bytes.size());
             })
        .def("save", &Rendering::save, nb::call_guard<nb::gil_scoped_release>(), "file"_a,
             "aovs"_a);
    m.def("check_aovs", &check_aovs, "names"_a);
    bind_merging(m);
}

}  // namespace etendue::python
