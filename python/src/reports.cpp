// Comparison and verification of methods.

#include <filesystem>
#include <mutex>

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <nlohmann/json.hpp>

#include "bindings.h"
#include "compare/comparison.h"
#include "compare/default_reference.h"
#include "compare/report.h"
#include "image/radiance_file.h"
#include "render/render_request.h"
#include "system/failure.h"
#include "values.h"
#include "verify/image_series.h"
#include "verify/report_json.h"
#include "verify/verify.h"

namespace etendue::python {
namespace {

/// The latest line of text about work in progress, handed from its thread to the caller's.
class StatusLine {
public:
    void set(const std::string& text) {
        const std::scoped_lock lock(mutex_);
        text_ = text;
    }
    void tell(const nb::object& listener) {
        std::string text;
        {
            const std::scoped_lock lock(mutex_);
            text = std::exchange(text_, {});
        }
        if (!text.empty() && !listener.is_none()) listener(text);
    }

private:
    std::mutex mutex_;
    std::string text_;
};

/// Runs `task(status, stop)`; KeyboardInterrupt goes on to the caller unless the task ends well in spite of it.
template <class Task>
bool run(const Task& task, const nb::object& listener) {
    use_threads();
    Background background;
    StatusLine status;
    background.run([&] { task(status, background.stop); }, [&] { status.tell(listener); });
    return background.interrupted;
}

[[noreturn]] void raise_interrupt() {
    PyErr_SetNone(PyExc_KeyboardInterrupt);
    throw nb::python_error();
}

PathSelection selection(int shortest, std::optional<int> longest, bool inner_only) {
    PathSelection p;
    p.shortest = shortest;
    p.longest = longest.value_or(PathSelection::kNoLimit);
    p.inner_only = inner_only;
    return p;
}

/// Name and folder of timed images.
using NamedFolders = std::vector<std::tuple<std::string, std::string>>;

struct ComparisonList {
    std::vector<Comparison> all;
};

std::string compare_all(std::shared_ptr<ComparisonList>& out, const std::vector<ScenePtr>& scenes,
                        const nb::list& methods, std::optional<double> time,
                        std::optional<uint64_t> spp, int runs, uint64_t seed,
                        const std::string& sampler, int threads, int technique_depth,
                        const std::string& paths, int shortest, std::optional<int> longest,
                        const nb::object& reference_method, std::optional<double> reference_time,
                        std::optional<uint64_t> reference_spp,
                        const std::vector<std::string>& references, const std::string& folder,
                        const NamedFolders& images, const nb::object& listener) {
    if (!images.empty() && scenes.size() > 1)
        throw nb::value_error("images are those of one scene, but several are given");
    if (time.has_value() == spp.has_value())
        throw nb::value_error("give either time, in seconds, or spp: how long each method renders");
    check_above_0("time, spp, reference_time and reference_spp",
                  {time, spp, reference_time, reference_spp});
    if (paths != "all" && paths != "inner")
        throw nb::value_error("paths must be \"all\" or \"inner\"");
    if (!references.empty() && references.size() != scenes.size())
        throw nb::value_error("reference needs one image per scene");

    struct Job {
        CompareSettings settings;
        RenderSettings reference;
    };
    std::vector<Job> jobs;
    nlohmann::json notes = nlohmann::json::array();
    for (const ScenePtr& scene : scenes) {
        Job job;
        CompareSettings& s = job.settings;
        for (nb::handle method : methods) {
            IntegratorSpec spec = to_spec(scene->scene, method);
            const std::string name =
                nb::isinstance<nb::str>(method) ? nb::cast<std::string>(method) : spec.to_string();
            s.methods.push_back({name, std::move(spec)});
        }
        s.sampler = sampler_named(sampler, "sampler");
        s.seed = seed;
        s.threads = checked_threads(threads);
        for (const MethodSpec& m : s.methods)
            if (m.integrator.make) s.threads = 1;
        s.limits.seconds = time;
        s.limits.spp = spp;
        s.runs = checked("runs", runs, 1, 10000);
        s.shown = selection(shortest, longest, paths == "inner");
        s.technique_depth = checked("techniques", technique_depth, 0, 16);
        for (const auto& [name, images_folder] : images)
            s.images.push_back(find_timed_images(name, images_folder, scene->scene.film()));
        check_methods(s);
        RenderSettings& r = job.reference;
        r.integrator = reference_method.is_none() ? reference_integrator(scene->scene, s.methods)
                                                  : to_spec(scene->scene, reference_method);
        r.sampler = s.sampler;
        r.threads = r.integrator.make ? 1 : threads;
        r.shown = s.shown;
        r.seconds = reference_time;
        r.spp = reference_spp;
        if (!r.seconds && !r.spp) static_cast<RenderLimits&>(r) = reference_limits(s.limits);
        if (references.empty()) {
            if (s.shown.inner_only) check_inner_paths(scene->scene, s.methods, r.integrator);
            for (const std::string& w : depth_warnings(s.methods, r.integrator)) notes.push_back(w);
        }
        jobs.push_back(std::move(job));
    }

    nlohmann::ordered_json failures = nlohmann::ordered_json::array();
    const auto fail = [&](size_t i, const std::string& reason) {
        failures.push_back({{"file", scenes[i]->scene.file()}, {"reason", reason}});
    };
    const uint64_t program = program_fingerprint();
    const bool interrupted = run(
        [&](StatusLine& status, std::atomic<bool>& stop) {
            // Scenes that fail do not lose those that were compared.
            for (size_t i = 0; i < jobs.size() && !stop; ++i) try {
                    const SceneHandle& scene = *scenes[i];
                    std::optional<Reference> reference;
                    if (!references.empty())
                        reference = read_reference(references[i], scene.scene.film());
                    else
                        reference = make_reference(
                            scene.scene, {jobs[i].reference, folder, scene.fingerprint, program},
                            [&](const Progress& p) {
                                status.set(fmt::format("reference, {} spp, {:.1f} s", p.passes,
                                                       p.seconds));
                            },
                            stop);
                    if (!reference) break;
                    out->all.push_back(compare(
                        scene.scene, *reference, jobs[i].settings,
                        [&](const std::string& text) { status.set(text); }, stop));
                } catch (...) {
                    fail(i, caught());
                }
        },
        listener);
    if (out->all.empty() && !failures.empty())
        throw std::runtime_error(failures[0]["reason"].get<std::string>());
    if (interrupted && out->all.empty()) raise_interrupt();
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    for (const Comparison& c : out->all) all.push_back(to_json(c));
    return json_text(
        nlohmann::ordered_json{{"scenes", all}, {"failures", failures}, {"warnings", notes}});
}

std::string verify_methods(const ScenePtr& scene, const nb::list& methods,
                           const VerifyOptions& options, const nb::object& listener) {
    std::vector<IntegratorSpec> specs;
    for (nb::handle method : methods)
        specs.push_back(nb::isinstance<nb::str>(method)
                            ? IntegratorSpec::parse(nb::cast<std::string>(method))
                            : to_spec(scene->scene, method));
    for (const IntegratorSpec& s : specs) make_integrator(s);
    std::optional<VerifyReport> report;
    const bool was_interrupted = run(
        [&](StatusLine& status, std::atomic<bool>& stop) {
            VerifyOptions o = options;
            o.interrupted = &stop;
            report = verify(scene->scene, specs, o, {},
                            [&](const std::string& text) { status.set(text); });
        },
        listener);
    if (was_interrupted && report->methods.empty()) raise_interrupt();
    return json_text(to_json(*report, scene->scene, options));
}

/// Files and folders, or names and pixels.
using NamedImages = std::vector<std::tuple<std::string, nb::object>>;

ImageSeries series_of(const NamedImages& images, int tiles) {
    ImageSeries series(tiles);
    for (const auto& [name, pixels] : images) {
        if (pixels.is_none()) {
            series.add_files({name});
            continue;
        }
        const auto array = nb::cast<ImageArgument>(pixels);
        const std::span<const Rgb> colours = pixels_of(array);
        RgbImage image{int(array.shape(1)), int(array.shape(0)), {}};
        image.pixels.assign(colours.begin(), colours.end());
        check_finite(name, image);
        series.add(name, image);
    }
    return series;
}

}  // namespace

void bind_reports(nb::module_& m) {
    using namespace nb::literals;
    nb::class_<ComparisonList>(m, "Comparisons")
        .def("save",
             [](const ComparisonList& c, const std::string& folder) {
                 nb::gil_scoped_release no_gil;
                 write_report(c.all, {folder, ETENDUE_VERSION});
             })
        .def("image",
             [](const ComparisonList& c, size_t scene, size_t method) {
                 const FilmGeometry& film = c.all.at(scene).film;
                 return to_array(std::vector<Rgb>(c.all[scene].methods.at(method).image),
                                 film.crop_width, film.crop_height);
             })
        .def("flip_map",
             [](const ComparisonList& c, size_t scene, size_t method) {
                 const FilmGeometry& film = c.all.at(scene).film;
                 return to_array(std::vector<float>(c.all[scene].methods.at(method).flip_map),
                                 film.crop_width, film.crop_height);
             })
        .def("reference", [](const ComparisonList& c, size_t scene) {
            const FilmGeometry& film = c.all.at(scene).film;
            return to_array(std::vector<Rgb>(c.all[scene].reference.pixels), film.crop_width,
                            film.crop_height);
        });
    m.def(
        "compare",
        [](const std::vector<ScenePtr>& scenes, const nb::list& methods, std::optional<double> time,
           std::optional<uint64_t> spp, int runs, uint64_t seed, const std::string& sampler,
           int threads, int technique_depth, const std::string& paths, int shortest,
           std::optional<int> longest, const nb::object& reference_method,
           std::optional<double> reference_time, std::optional<uint64_t> reference_spp,
           const std::vector<std::string>& references, const std::string& folder,
           const NamedFolders& images, const nb::object& listener) {
            auto out = std::make_shared<ComparisonList>();
            std::string json =
                compare_all(out, scenes, methods, time, spp, runs, seed, sampler, threads,
                            technique_depth, paths, shortest, longest, reference_method,
                            reference_time, reference_spp, references, folder, images, listener);
            return std::tuple{out, json};
        },
        "scenes"_a, "methods"_a, "time"_a.none(), "spp"_a.none(), "runs"_a, "seed"_a, "sampler"_a,
        "threads"_a, "technique_depth"_a, "paths"_a, "shortest"_a, "longest"_a.none(),
        "reference_method"_a.none(), "reference_time"_a.none(), "reference_spp"_a.none(),
        "references"_a, "folder"_a, "images"_a, "listener"_a.none());
    m.def(
        "verify_images",
        [](const NamedImages& images, const NamedImages& against, double alpha, int tiles) {
            if (!(alpha >= 1e-9 && alpha <= 0.5))
                throw nb::value_error("alpha must lie between 1e-9 and 0.5");
            checked("tiles", tiles, 1, 64);
            const ImageSeries a = series_of(images, tiles), b = series_of(against, tiles);
            return json_text(to_json(verify_images(a, b, alpha), a, b, alpha));
        },
        "images"_a, "against"_a, "alpha"_a, "tiles"_a);
    m.def(
        "verify",
        [](const ScenePtr& scene, const nb::list& methods, std::optional<uint64_t> spp,
           std::optional<double> time, std::optional<double> detect, int shortest, int longest,
           int runs, double alpha, const std::vector<std::string>& against, int tiles,
           uint64_t seed, const std::string& sampler, int threads, const nb::object& listener) {
            VerifyOptions o;
            if (shortest < 1 || longest < shortest || longest > PathClass::kMostEdges)
                throw nb::value_error("lengths must be (shortest, longest), within 1 to 24 edges");
            check_above_0("time and spp", {time, spp});
            if (!(alpha >= 1e-9 && alpha <= 0.5))
                throw nb::value_error("alpha must lie between 1e-9 and 0.5");
            if (detect && !(*detect >= 1e-4 && *detect < 1))
                throw nb::value_error(
                    "detect must be a share from 0.0001 to below 1, such as 0.005");
            if (spp && time && !detect)
                throw nb::value_error("time and spp exclude each other, except with detect");
            o.shortest = shortest;
            o.longest = longest;
            o.runs = checked("runs", runs, 8, 4096);
            o.alpha = alpha;
            o.sampler = sampler_named(sampler, "sampler");
            o.spp = spp;
            o.seconds = time;
            o.detect = detect;
            o.seed = seed;
            o.threads = checked_threads(threads);
            o.tiles = checked("tiles", tiles, 1, 64);
            o.against.clear();
            for (const std::string& a : against) o.against.push_back(IntegratorSpec::parse(a));
            if (o.against.empty()) throw nb::value_error("against must name a method");
            return verify_methods(scene, methods, o, listener);
        },
        "scene"_a, "methods"_a, "spp"_a.none(), "time"_a.none(), "detect"_a.none(), "shortest"_a,
        "longest"_a, "runs"_a, "alpha"_a, "against"_a, "tiles"_a, "seed"_a, "sampler"_a,
        "threads"_a, "listener"_a.none());
}

}  // namespace etendue::python
