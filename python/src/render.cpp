// Rendering on a thread of its own, and what it leaves.

#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>

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

namespace etendue::python {

SamplerKind to_sampler(const std::string& name) {
    if (const auto kind = sampler_kind(name)) return *kind;
    throw nb::value_error(
        fmt::format("sampler must be \"independent\" or \"sobol\", but is \"{}\"", name).c_str());
}

namespace {

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
                            int threads, int technique_depth) {
    RenderSettings s;
    s.integrator = to_spec(scene.scene, integrator);
    s.sampler = to_sampler(sampler);
    s.seed = seed;
    // Objects of Python work on one thread.
    s.threads = s.integrator.make ? 1 : threads;
    s.spp = spp;
    s.seconds = seconds;
    s.error = error;
    if ((spp && *spp == 0) || (seconds && !(*seconds > 0)) || (error && !(*error > 0)))
        throw nb::value_error("spp, time and error must be above 0");
    set_default_limit(s, scene.scene);
    s.technique_depth = technique_depth;
    return s;
}

/// A renderer with its scene.
class Rendering {
public:
    Rendering(ScenePtr scene, nb::handle integrator, std::optional<uint64_t> spp,
              std::optional<double> seconds, std::optional<double> error, uint64_t seed,
              const std::string& sampler, int threads, int technique_depth)
        : scene_(std::move(scene)),
          settings_(settings_for(*scene_, integrator, spp, seconds, error, seed, sampler, threads,
                                 technique_depth)),
          renderer_(scene_->scene, settings_) {}

    /// `tick()` is called every 50 ms, `callback()` between passes, at least `interval` seconds apart; it returns False to
    /// stop.
    std::string run(nb::object tick, nb::object callback, double interval) {
        Background background;
        std::atomic<bool> asked_to_stop{false};
        double last = -std::numeric_limits<double>::infinity();
        const std::function<void()> call = [&] {
            const nb::object answer = callback();
            if (answer.is(nb::bool_(false))) asked_to_stop = true;
        };
        const auto progress = [&](const Progress& p) {
            log_.add(p.seconds, renderer_.stats().pairs);
            {
                const std::scoped_lock lock(mutex_);
                now_ = p;
            }
            if (callback.is_none() || p.seconds - last < interval) return;
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
    const Renderer& renderer() const { return renderer_; }
    int width() const { return scene_->scene.film().crop_width; }
    int height() const { return scene_->scene.film().crop_height; }
    const Film& film() const { return renderer_.film(); }

    /// Passes, seconds, fraction, rays a second, relative error; as of the last finished pass, while it runs.
    std::optional<
        std::tuple<uint64_t, double, std::optional<double>, double, std::optional<double>>>
    now() const {
        const std::scoped_lock lock(mutex_);
        if (!now_) return {};
        return std::tuple{now_->passes, now_->seconds, now_->fraction, now_->rays_per_second,
                          now_->error.valid ? std::optional(now_->error.relative_rms)
                                            : std::nullopt};
    }

    /// 95 % half width of every pixel's confidence interval.
    std::vector<Rgb> half_width() const {
        std::vector<Rgb> out = film().variance();
        // Where passes depend on each other, groups of them are the independent values.
        const int groups = renderer_.integrator().error_groups();
        const double samples = groups > 0 ? groups / 2 + 1 : double(film().passes());
        const bool is_known = samples >= 2 && film().passes() >= uint64_t(std::max(groups, 2));
        const double t = is_known ? student_quantile(0.05, samples - 1)
                                  : std::numeric_limits<double>::quiet_NaN();
        for (Rgb& c : out)
            for (int i = 0; i < 3; ++i) c[i] = float(t * std::sqrt(double(c[i])));
        return out;
    }

    nlohmann::json report() const {
        return to_json(renderer_, scene_->scene, settings_, stopped_by_, log_);
    }
    void save(const std::string& file, const std::vector<std::string>& aovs) const {
        check_image_extension(file);
        write_image(file, image_with_layers(renderer_, scene_->scene, settings_.seed,
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
    std::optional<Progress> now_;
    PassLog log_;
    std::string stopped_by_;
};
using RenderingPtr = std::shared_ptr<Rendering>;

/// A view of the film's sums, or of the sums of squares, that keeps the rendering alive.
ReadOnlyDoubles sums(const RenderingPtr& r, bool squares) {
    const auto moments = r->film().moments();
    const double* data = squares ? moments.front().square : moments.front().sum;
    constexpr int64_t kStride = sizeof(Film::Moments) / sizeof(double);
    const size_t w = size_t(r->width()), h = size_t(r->height());
    return ReadOnlyDoubles(data, {h, w, 3}, nb::cast(r), {int64_t(w) * kStride, kStride, 1});
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
               const std::string& sampler, int threads, int technique_depth) {
                new (self) Rendering(std::move(scene), integrator, spp, time, error, seed, sampler,
                                     threads, technique_depth);
            },
            "scene"_a, "integrator"_a, "spp"_a.none(), "time"_a.none(), "error"_a.none(), "seed"_a,
            "sampler"_a, "threads"_a, "technique_depth"_a)
        .def("run", &Rendering::run, "tick"_a.none(), "callback"_a.none(), "interval"_a)
        .def("now", &Rendering::now)
        .def_prop_ro("scene", &Rendering::scene_pointer)
        .def_prop_ro("passes", [](const Rendering& r) { return r.film().passes(); })
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
                 const ErrorEstimate e = r.film().error();
                 if (!e.valid) return {};
                 return std::tuple{e.relative_rms, e.low, e.high};
             })
        .def("image",
             [](const Rendering& r) { return to_array(r.film().image(), r.width(), r.height()); })
        .def(
            "variance",
            [](const Rendering& r) { return to_array(r.film().variance(), r.width(), r.height()); })
        .def("half_width",
             [](const Rendering& r) { return to_array(r.half_width(), r.width(), r.height()); })
        .def("sums", [](const RenderingPtr& r) { return sums(r, false); })
        .def("squares", [](const RenderingPtr& r) { return sums(r, true); })
        .def("stats", [](const Rendering& r) { return r.report().dump(); })
        .def(
            "techniques",
            [](const Rendering& r) {
                nb::list all;
                if (!r.renderer().techniques()) return all;
                for (auto& e : r.renderer().techniques()->images()) {
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
                    nb::gil_scoped_release no_gil;
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
