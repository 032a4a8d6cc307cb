#include "compare/comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "compare/memory.h"
#include "image/flip.h"
#include "image/radiance_file.h"
#include "integrator/auto.h"
#include "math/statistics.h"
#include "render/method_choice.h"
#include "render/warnings.h"
#include "system/failure.h"

namespace etendue {
namespace {

/// Renderer and measurements of one method in one run.
struct MethodRun {
    std::unique_ptr<Renderer> renderer;
    MemoryMeter memory;
    std::vector<Checkpoint> checkpoints;
    std::string failure;  ///< Why it ended early; empty otherwise.

    /// Calls `task`. If it fails, the method gets no further turns, and the others go on.
    template <class Task>
    void attempt(const Task& task) {
        if (failure.empty()) failure = failure_of(task);
    }
};

ImageErrors errors_of(const std::vector<Rgb>& image, const Reference& r) {
    return image_errors(image, r.half(0), {.reference2 = r.half(1)});
}

void add_checkpoint(MethodRun& c, const Reference& reference) {
    const Film& film = c.renderer->film();
    if (film.passes() == 0) return;
    if (!c.checkpoints.empty() && c.checkpoints.back().spp == film.passes()) return;
    c.checkpoints.push_back(
        {film.passes(), c.renderer->seconds(), errors_of(film.image(), reference)});
}

Run finished_run(const MethodRun& c, uint64_t seed, const Reference& reference) {
    const Renderer& r = *c.renderer;
    Run run;
    run.seed = seed;
    run.spp = r.film().passes();
    run.seconds = r.seconds();
    run.stats = r.stats();
    run.mean = r.film().mean_luminance();
    run.checkpoints = c.checkpoints;
    run.uncorrected = image_errors(r.film().image(), reference.pixels);
    return run;
}

/// The images are read again, one at a time, since they may be many.
Method measured(const TimedImages& images, const Reference& reference) {
    Method m;
    m.spec.name = images.name;
    m.folder = images.folder;
    for (const std::vector<TimedImages::File>& files : images.runs) {
        Run run;
        std::vector<Rgb> last;
        for (const TimedImages::File& file : files) {
            last = read_radiance(file.path).pixels;
            run.checkpoints.push_back({file.spp, file.seconds, errors_of(last, reference)});
        }
        run.seed = m.runs.size();
        run.spp = files.back().spp;
        run.seconds = files.back().seconds;
        run.uncorrected = image_errors(last, reference.pixels);
        if (m.runs.empty()) m.image = std::move(last);
        m.runs.push_back(std::move(run));
    }
    return m;
}

RenderSettings render_settings(const CompareSettings& s, const IntegratorSpec& integrator,
                               uint64_t seed) {
    RenderSettings settings;
    settings.integrator = integrator;
    settings.sampler = s.sampler;
    settings.seed = seed;
    settings.threads = s.threads;
    settings.shown = s.shown;
    static_cast<RenderLimits&>(settings) = s.limits;  // by which `auto` chooses
    return settings;
}

/// The order of the methods is reversed in every other round, so that a machine that slows down affects all of them
/// equally.
void render_in_turns(std::vector<MethodRun>& method_runs, const CompareSettings& settings,
                     const Reference& reference, const CompareProgress& progress,
                     const std::string& label, const std::atomic<bool>& interrupted) {
    bool forwards = true;
    for (const Turn& turn : schedule(settings.limits)) {
        for (size_t i = 0; i < method_runs.size(); ++i) {
            const size_t method = forwards ? i : method_runs.size() - 1 - i;
            MethodRun& c = method_runs[method];
            c.memory.begin();
            c.attempt([&] {
                c.renderer->run(
                    turn.limits,
                    [&](const Progress& p) {
                        progress(fmt::format("{}{}: {} spp, {:.1f} s", label,
                                             settings.methods[method].name, p.passes, p.seconds));
                    },
                    interrupted);
            });
            c.memory.end();
            if (interrupted.load()) return;
            if (turn.is_checkpoint) c.attempt([&] { add_checkpoint(c, reference); });
        }
        forwards = !forwards;
    }
}

/// Technique images are rendered separately, since they cost time; in a quarter of the method's time.
void render_techniques(const Scene& scene, const CompareSettings& settings, Method& method,
                       const std::atomic<bool>& interrupted) {
    RenderSettings s = render_settings(settings, method.spec.integrator, settings.seed);
    if (method.choice) {
        s = with_chosen_method(s, *method.choice);
        s.choice = nullptr;  // The time of its pilots is not that of these images.
    }
    s.technique_depth = settings.technique_depth;
    s.seconds = method.runs.front().seconds / 4;
    Renderer renderer(scene, s);
    renderer.run([](const Progress&) {}, interrupted);
    method.techniques = renderer.techniques()->images();
    method.technique_spp = renderer.film().passes();
}

/// n, n/√2, n/2, ... or n, n/2, n/4, ... in ascending order.
std::vector<double> geometric_steps(double last, double first, double factor) {
    std::vector<double> steps;
    for (double v = last; v >= first; v /= factor) steps.push_back(v);
    std::reverse(steps.begin(), steps.end());
    return steps;
}

template <class Get>
std::vector<double> of_runs(const Method& m, const Get& get) {
    std::vector<double> values;
    for (const Run& r : m.runs) values.push_back(double(get(r)));
    return values;
}

double mean(const std::vector<double>& values) {
    double sum = 0;
    for (double v : values) sum += v;
    return values.empty() ? 0 : sum / double(values.size());
}

/// The error against time of one run.
template <class Get>
std::optional<PowerLaw> slope(const Run& run, const Get& get) {
    std::vector<double> times, errors;
    for (const Checkpoint& c : run.checkpoints) {
        times.push_back(c.seconds);
        errors.push_back(get(c.errors));
    }
    // Early checkpoints are left out: few samples have not found rare paths yet.
    return fit_power_law(times, errors, times.empty() ? 0 : times.back() / 32);
}

template <class Get>
std::optional<PowerLaw> mean_slope(const Method& m, const Get& get, std::vector<double>& slopes) {
    double log_factor = 0;
    int points = 0;
    for (const Run& r : m.runs)
        if (const auto law = slope(r, get)) {
            slopes.push_back(law->slope);
            log_factor += std::log(law->factor);
            points += law->points;
        }
    if (slopes.empty()) return {};
    return PowerLaw{mean(slopes), std::exp(log_factor / double(slopes.size())), points};
}

/// Square of the relative standard error of the mean over the runs of the images' means; infinite where it is unknown.
SquaredError error_of_mean(const Method& m) {
    const auto runs = double(m.runs.size());
    std::vector<SquaredError> errors;
    for (const Run& r : m.runs)
        if (r.mean.standard_error && r.mean.mean > 0)
            errors.push_back(
                {sqr(*r.mean.standard_error / r.mean.mean / runs), double(r.mean.count - 1)});
    if (errors.size() == m.runs.size()) return sum(errors);
    // The spread of the runs remains.
    Moments ratios;
    for (const Run& r : m.runs) ratios.add(r.errors().mean_ratio);
    if (ratios.count() < 2 || !(ratios.mean() > 0)) return kUnknownError;
    return {ratios.squared_error() / sqr(ratios.mean()), double(ratios.count() - 1)};
}

}  // namespace

std::vector<std::string> Method::warnings() const {
    RenderStats all;
    for (const Run& r : runs) all += r.stats;
    std::vector<std::string> texts = etendue::warnings(all);
    texts.insert(texts.end(), memory_warnings.begin(), memory_warnings.end());
    return texts;
}

void check_methods(const std::vector<MethodSpec>& methods) {
    for (size_t i = 0; i < methods.size(); ++i) {
        make_integrator(methods[i].integrator);
        for (size_t j = 0; j < i; ++j)
            if (methods[i].integrator.to_string() == methods[j].integrator.to_string())
                throw std::runtime_error(
                    fmt::format("method \"{}\" is given twice", methods[i].name));
    }
}

void check_methods(const CompareSettings& settings) {
    check_methods(settings.methods);
    std::set<std::string> names;
    for (const MethodSpec& m : settings.methods) names.insert(m.name);
    for (const TimedImages& images : settings.images)
        if (!names.insert(images.name).second)
            throw std::runtime_error(fmt::format("method \"{}\" is given twice", images.name));
}

void check_inner_paths(const Scene& scene, const std::vector<MethodSpec>& methods,
                       const IntegratorSpec& reference) {
    // Methods with learned weights of pairs have no fixed counts, since the weights differ between renderings.
    const auto fixed_counts = [&](const IntegratorSpec& spec) -> std::optional<TechniqueCounts> {
        if (is_auto(spec)) return std::nullopt;
        const auto integrator = make_integrator(spec);
        const TechniqueCounts counts = integrator->counts(scene, scene.film().pixel_count());
        const bool learns = counts.gather > 0 || (counts.merge > 0 && counts.connect > 0);
        return learns ? std::nullopt : std::optional(counts);
    };
    const auto expected = fixed_counts(reference);
    for (const MethodSpec& m : methods) {
        const auto own = fixed_counts(m.integrator);
        if (!own || !expected || !(*own == *expected))
            throw std::runtime_error(fmt::format(
                "--paths inner: \"{}\" weights its techniques differently than the reference "
                "\"{}\", so that their inner paths have different means",
                m.name, reference.to_string()));
    }
}

std::vector<Turn> schedule(const RenderLimits& limits) {
    constexpr double kTurns = 32, kLongestTurn = 2;
    std::vector<Turn> turns;
    if (limits.seconds) {
        const double total = *limits.seconds, longest = std::min(total / kTurns, kLongestTurn);
        double previous = 0;
        for (const double step : geometric_steps(total, total / 300, std::sqrt(2.0))) {
            const int parts = std::max(1, int(std::ceil((step - previous) / longest)));
            for (int i = 1; i <= parts; ++i)
                turns.push_back({{.spp = limits.spp,
                                  .seconds = previous + (step - previous) * i / parts,
                                  .error = {}},
                                 i == parts});
            previous = step;
        }
        return turns;
    }
    const uint64_t total = limits.spp.value_or(1);
    const auto longest = uint64_t(std::ceil(double(total) / kTurns));
    uint64_t previous = 0;
    for (const double step : geometric_steps(double(total), 1, 2)) {
        const auto target = uint64_t(std::ceil(step));
        while (previous < target) {
            previous = std::min(previous + longest, target);
            turns.push_back({{.spp = previous, .seconds = {}, .error = {}}, previous == target});
        }
    }
    return turns;
}

Comparison compare(const Scene& scene, const Reference& reference, const CompareSettings& settings,
                   const CompareProgress& progress, const std::atomic<bool>& interrupted) {
    Comparison out;
    out.scene_file = scene.file();
    out.film = scene.film();
    out.settings = settings;
    out.reference = reference;
    out.scene_bytes = resident_bytes();
    if (reference.has_variance()) {
        // (R − R1)(R − R2) = −(R1 − R2)²/4, R being the mean of the two.
        const ImageErrors noise = errors_of(reference.pixels, reference);
        out.reference_mse = -noise.mse;
        out.reference_rel_mse = -noise.rel_mse;
    }
    check_methods(settings);
    for (const MethodSpec& spec : settings.methods) out.methods.emplace_back().spec = spec;

    for (int index = 0; index < settings.runs && !interrupted.load(); ++index) {
        const uint64_t seed = settings.seed + uint64_t(index);
        std::vector<MethodRun> method_runs(settings.methods.size());
        for (size_t i = 0; i < method_runs.size(); ++i) {
            MethodRun& c = method_runs[i];
            c.memory.begin();
            c.attempt([&] {
                c.renderer = std::make_unique<Renderer>(
                    scene, render_settings(settings, settings.methods[i].integrator, seed));
                if (index > 0) return;
                out.methods[i].memory_warnings = memory_warnings(*c.renderer);
                for (const std::string& w : out.methods[i].memory_warnings)
                    progress(fmt::format("{}: {}", out.methods[i].name(), w));
            });
            c.memory.end();
        }
        const std::string label =
            settings.runs > 1 ? fmt::format("run {} of {}, ", index + 1, settings.runs) : "";
        render_in_turns(method_runs, settings, reference, progress, label, interrupted);
        for (size_t i = 0; i < method_runs.size(); ++i) {
            MethodRun& c = method_runs[i];
            Method& m = out.methods[i];
            if (!c.failure.empty()) {
                out.failures.push_back(fmt::format("{}{} failed: {}", label, m.name(), c.failure));
                continue;
            }
            add_checkpoint(c, reference);
            if (c.checkpoints.empty()) continue;  // interrupted before its first pass
            m.runs.push_back(finished_run(c, seed, reference));
            if (m.runs.size() > 1) continue;
            m.estimator = c.renderer->integrator().estimator();
            m.choice = c.renderer->settings().choice;
            m.image = c.renderer->film().image();
            m.peak_bytes = c.memory.peak_bytes();
        }
    }
    for (const TimedImages& images : settings.images) {
        progress(fmt::format("{}: errors", images.name));
        const std::string failure =
            failure_of([&] { out.methods.push_back(measured(images, reference)); });
        if (!failure.empty())
            out.failures.push_back(fmt::format("{} failed: {}", images.name, failure));
    }
    for (Method& m : out.methods) {
        if (m.runs.empty()) continue;
        progress(fmt::format("{}: FLIP", m.name()));
        FlipResult flip = hdr_flip(m.image, reference.pixels, reference.width, reference.height);
        m.flip = flip.mean;
        m.flip_map = std::move(flip.map);
        if (settings.technique_depth == 0 || interrupted.load() || !m.folder.empty()) continue;
        progress(fmt::format("{}: technique images", m.name()));
        const std::string failure =
            failure_of([&] { render_techniques(scene, settings, m, interrupted); });
        if (!failure.empty())
            out.failures.push_back(
                fmt::format("technique images of {} failed: {}", m.name(), failure));
    }
    std::erase_if(out.methods, [](const Method& m) { return m.runs.empty(); });
    if (out.methods.empty() && !out.failures.empty()) throw std::runtime_error(out.failures[0]);
    out.interrupted = interrupted.load();
    return out;
}

std::vector<MethodSummary> summarize(const Comparison& comparison) {
    std::vector<MethodSummary> out;
    std::vector<double> base_costs;
    for (const Method& m : comparison.methods) {
        MethodSummary& s = out.emplace_back();
        s.spp = mean(of_runs(m, [](const Run& r) { return r.spp; }));
        s.seconds = mean(of_runs(m, [](const Run& r) { return r.seconds; }));
        s.rays = mean(of_runs(m, [](const Run& r) { return r.stats.rays(); }));
        s.rmse =
            std::sqrt(std::max(0.0, mean(of_runs(m, [](const Run& r) { return r.errors().mse; }))));
        const std::vector<double> rel_mse =
            of_runs(m, [](const Run& r) { return r.errors().rel_mse; });
        s.rel_mse = mean(rel_mse);
        s.rel_mse_interval = mean_interval(rel_mse);
        s.rel_mse_trimmed =
            mean(of_runs(m, [](const Run& r) { return r.errors().rel_mse_trimmed; }));
        s.mape = mean(of_runs(m, [](const Run& r) { return r.errors().mape; }));
        s.spike = mean(of_runs(m, [](const Run& r) { return r.errors().spike; }));

        s.mean_ratio =
            ratio_interval(mean(of_runs(m, [](const Run& r) { return r.errors().mean_ratio; })),
                           error_of_mean(m), comparison.reference.mean_error);

        std::vector<double> rmse_slopes, slopes;
        s.rmse_slope = mean_slope(
            m, [](const ImageErrors& e) { return e.rmse; }, rmse_slopes);
        s.rel_mse_slope = mean_slope(
            m, [](const ImageErrors& e) { return e.rel_mse; }, slopes);
        s.rel_mse_slope_interval = mean_interval(slopes);

        // Runs may have different lengths, such as those of another program.
        const std::vector<double> costs =
            of_runs(m, [](const Run& r) { return r.errors().rel_mse * r.seconds; });
        if (out.size() == 1) base_costs = costs;
        s.efficiency = relative_efficiency(base_costs, costs);
        const double measured =
            mean(of_runs(m, [](const Run& r) { return r.uncorrected.rel_mse; }));
        if (comparison.reference.has_variance() && measured > 0)
            s.reference_share = 1 - s.rel_mse / measured;
    }
    return out;
}

}  // namespace etendue
