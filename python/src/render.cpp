// Rendering on a thread of its own, and what it leaves.

#include <atomic>
#include <cmath>
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
#include "image/image_io.h"
#include "math/statistics.h"
#include "render/aov.h"
#include "render/defaults.h"
#include "render/render_report.h"
#include "render/renderer.h"
#include "render/warnings.h"
#include "values.h"

namespace etendue::python {

SamplerKind to_sampler(const std::string& name) {
    if (const auto kind = sampler_kind(name)) return *kind;
    throw nb::value_error(
        fmt::format("sampler must be \"independent\" or \"sobol\", but is \"{}\"", name).c_str());
}

namespace {

FilterMode to_filter_mode(const std::string& name) {
    if (const auto mode = filter_mode(name)) return *mode;
    throw nb::value_error(
        fmt::format("filter_mode must be \"spread\" or \"sample\", but is \"{}\"", name).c_str());
}

const char* technique_kind(const Technique& q) {
    switch (q.strategy) {
    case Strategy::Hit: return "hit";
    case Strategy::NextEvent: return "next_event";
    case Strategy::Connect: return q.s == 1 ? "stored" : "connect";
    case Strategy::Splat: return "splat";
    case Strategy::HitLens: return "hit_lens";
    case Strategy::Merge: return "merge";
    case Strategy::Gather: return "gather";
    }
    return "";
}

RenderSettings settings_for(const SceneHandle& scene, nb::handle integrator,
                            std::optional<uint64_t> spp, std::optional<double> seconds,
                            std::optional<double> error, uint64_t seed, const std::string& sampler,
                            const std::string& filter, int threads, int technique_depth) {
    RenderSettings s;
    s.integrator = to_spec(scene.scene, integrator);
    s.sampler = to_sampler(sampler);
    s.filter_mode = to_filter_mode(filter);
    s.seed = seed;
    // Objects of Python work on one thread.
    s.threads = s.integrator.make ? 1 : checked_threads(threads);
    s.spp = spp;
    s.seconds = seconds;
    s.error = error;
    check_above_0("spp, time and error", {spp, seconds, error});
    set_default_limit(s, scene.scene);
    s.technique_depth = checked("techniques", technique_depth, 0, 64);
    return s;
}

/// Trial renderings of the integrator take time.
Renderer make_renderer(const Scene& scene, const RenderSettings& settings) {
    use_threads();
    const nb::gil_scoped_release no_gil;
    return Renderer(scene, settings);
}

/// A renderer with its scene.
class Rendering {
public:
    Rendering(ScenePtr scene, nb::handle integrator, std::optional<uint64_t> spp,
              std::optional<double> seconds, std::optional<double> error, uint64_t seed,
              const std::string& sampler, const std::string& filter, int threads,
              int technique_depth)
        : scene_(std::move(scene)),
          settings_(settings_for(*scene_, integrator, spp, seconds, error, seed, sampler, filter,
                                 threads, technique_depth)),
          renderer_(make_renderer(scene_->scene, settings_)) {}

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
            log_.add(p.seconds, renderer_.stats().pairs);
            const bool calls = !callback.is_none() && p.seconds - last >= interval;
            // Callbacks may stop the rendering by its error, and are told that of this pass.
            const ErrorEstimate error = calls ? p.error() : recent.update(p);
            {
                const std::scoped_lock lock(mutex_);
                now_ = Now{p.passes, p.seconds, p.fraction, p.rays_per_second,
                           error.valid ? std::optional(error.relative_rms) : std::nullopt};
            }
            if (!calls) return;
            last = p.seconds;
            background.call(call);
        };
        StopReason reason = StopReason::Samples;
        background.run(
            [&] {
                reason = renderer_.run(
                    [&](const Progress& p) {
                        progress(p);
                        if (asked_to_stop) background.stop = true;
                    },
                    background.stop, background.drop);
            },
            [&] {
                if (!tick.is_none()) tick();
            });
        stopped_by_ = asked_to_stop && !background.interrupted && reason == StopReason::Interrupted
                          ? "callback"
                          : to_string(reason);
        return stopped_by_;
    }

    const SceneHandle& scene() const { return *scene_; }
    ScenePtr scene_pointer() const { return scene_; }
    int width() const { return scene_->scene.film().crop_width; }
    int height() const { return scene_->scene.film().crop_height; }
    /// The film and all else of the renderer. Passes change them, so that they can be read in callbacks and after the
    /// rendering only.
    const Renderer& renderer() const {
        if (is_running_ && reader_ != std::this_thread::get_id())
            throw std::runtime_error("the rendering is running: its images and statistics can be "
                                     "read in callbacks, and when it has ended");
        return renderer_;
    }
    const Film& film() const { return renderer().film(); }
    /// Whether the film may still change.
    bool is_running() const { return is_running_; }

    /// Passes, seconds, fraction, rays a second, relative error; as of the last finished pass, while it runs.
    using Now = std::tuple<uint64_t, double, std::optional<double>, double, std::optional<double>>;
    std::optional<Now> now() const {
        const std::scoped_lock lock(mutex_);
        return now_;
    }

    /// 95 % half width of every pixel's confidence interval.
    std::vector<Rgb> half_width() const {
        std::vector<Rgb> out = film().variance();
        // Where passes depend on each other, groups of them are the independent values.
        const int groups = renderer().integrator().error_groups();
        const double samples = groups > 0 ? groups / 2 + 1 : double(film().passes());
        const bool is_known = samples >= 2 && film().passes() >= uint64_t(std::max(groups, 2));
        const double t = is_known ? student_quantile(0.05, samples - 1)
                                  : std::numeric_limits<double>::quiet_NaN();
        for (Rgb& c : out)
            for (int i = 0; i < 3; ++i) c[i] = float(t * std::sqrt(double(c[i])));
        return out;
    }

    nlohmann::json report() const {
        return to_json(renderer(), scene_->scene, settings_, stopped_by_, log_);
    }
    void save(const std::string& file, const std::vector<std::string>& aovs) const {
        check_image_extension(file);
        use_threads();
        write_image(file, image_with_layers(renderer(), scene_->scene, settings_.seed,
                                            settings_.threads, aovs, report()));
    }
    std::vector<AovImage> aovs(const std::vector<std::string>& names) const {
        return render_aovs(scene_->scene, names, kAovSamples, settings_.seed, settings_.threads);
    }
    const RenderSettings& settings() const { return settings_; }

private:
    ScenePtr scene_;
    RenderSettings settings_;
    Renderer renderer_;
    mutable std::mutex mutex_;
    std::optional<Now> now_;
    std::atomic<bool> is_running_{false};
    std::atomic<std::thread::id> reader_{};  ///< The thread of a callback that runs.
    PassLog log_;
    std::string stopped_by_;
};
using RenderingPtr = std::shared_ptr<Rendering>;

/// The film's sums, or the sums of squares. After the rendering, a view that keeps it alive. The film of a running one
/// changes when the callback has ended, so that callbacks get copies.
ReadOnlyDoubles sums(const RenderingPtr& r, bool squares) {
    const auto moments = r->film().moments();
    const size_t w = size_t(r->width()), h = size_t(r->height());
    if (r->is_running()) {
        auto copy = std::make_unique<std::vector<double>>();
        copy->reserve(3 * moments.size());
        for (const Film::Moments& m : moments)
            for (const double v : squares ? m.square : m.sum) copy->push_back(v);
        const double* data = copy->data();
        nb::capsule owner(copy.release(),
                          [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
        return ReadOnlyDoubles(data, {h, w, 3}, owner);
    }
    const double* data = squares ? moments.front().square : moments.front().sum;
    constexpr int64_t kStride = sizeof(Film::Moments) / sizeof(double);
    return ReadOnlyDoubles(data, {h, w, 3}, nb::cast(r), {int64_t(w) * kStride, kStride, 1});
}

/// An image of the film, which is computed without the GIL.
template <class Make>
FloatArray image_of(const Rendering& r, const Make& make) {
    std::vector<Rgb> pixels;
    {
        const nb::gil_scoped_release no_gil;
        pixels = make();
    }
    return to_array(std::move(pixels), r.width(), r.height());
}

}  // namespace

void bind_render(nb::module_& m) {
    using namespace nb::literals;
    using Strings = std::vector<std::string>;
    nb::class_<Rendering>(m, "Rendering")
        .def(
            "__init__",
            [](Rendering* self, ScenePtr scene, nb::handle integrator, std::optional<uint64_t> spp,
               std::optional<double> time, std::optional<double> error, uint64_t seed,
               const std::string& sampler, const std::string& filter, int threads,
               int technique_depth) {
                new (self) Rendering(std::move(scene), integrator, spp, time, error, seed, sampler,
                                     filter, threads, technique_depth);
            },
            "scene"_a, "integrator"_a, "spp"_a.none(), "time"_a.none(), "error"_a.none(), "seed"_a,
            "sampler"_a, "filter_mode"_a, "threads"_a, "technique_depth"_a)
        .def("run", &Rendering::run, "tick"_a.none(), "callback"_a.none(), "interval"_a)
        .def("now", &Rendering::now)
        .def_prop_ro("scene", &Rendering::scene_pointer)
        .def_prop_ro("passes",
                     [](const Rendering& r) {
                         const auto now = r.now();
                         return now ? std::get<0>(*now) : 0;
                     })
        .def_prop_ro("seconds", [](const Rendering& r) { return r.renderer().seconds(); })
        .def_prop_ro("estimator",
                     [](const Rendering& r) {
                         return std::string(to_string(r.renderer().integrator().estimator()));
                     })
        .def_prop_ro("integrator",
                     [](const Rendering& r) { return r.settings().integrator.to_string(); })
        .def_prop_ro("warnings", [](const Rendering& r) { return warnings(r.renderer().stats()); })
        .def("error",
             [](const Rendering& r) -> std::optional<std::tuple<double, double, double>> {
                 const nb::gil_scoped_release no_gil;
                 const ErrorEstimate e = r.renderer().error();
                 if (!e.valid) return {};
                 return std::tuple{e.relative_rms, e.low, e.high};
             })
        .def("image",
             [](const Rendering& r) { return image_of(r, [&] { return r.film().image(); }); })
        .def("variance",
             [](const Rendering& r) { return image_of(r, [&] { return r.film().variance(); }); })
        .def("half_width",
             [](const Rendering& r) { return image_of(r, [&] { return r.half_width(); }); })
        .def("sums", [](const RenderingPtr& r) { return sums(r, false); })
        .def("squares", [](const RenderingPtr& r) { return sums(r, true); })
        .def("stats",
             [](const Rendering& r) {
                 const nb::gil_scoped_release no_gil;
                 return json_text(r.report());
             })
        .def(
            "techniques",
            [](const Rendering& r) {
                nb::list all;
                if (!r.renderer().techniques()) return all;
                std::vector<TechniqueImages::Entry> images;
                {
                    const nb::gil_scoped_release no_gil;
                    images = r.renderer().techniques()->images();
                }
                for (auto& e : images) {
                    const Technique q = e.technique;
                    all.append(
                        nb::make_tuple(q.s, q.t, technique_kind(q),
                                       to_array(std::move(e.weighted), r.width(), r.height()),
                                       to_array(std::move(e.unweighted), r.width(), r.height())));
                }
                return all;
            },
            nb::sig("def techniques(self) -> list[tuple[int, int, str, "
                    "numpy.typing.NDArray[numpy.float32], "
                    "numpy.typing.NDArray[numpy.float32]]]"))
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
        .def("save", &Rendering::save, nb::call_guard<nb::gil_scoped_release>(), "file"_a,
             "aovs"_a);
    m.def("check_aovs", &check_aovs, "names"_a);
}

}  // namespace etendue::python
