#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "compare/comparison.h"
#include "compare/default_reference.h"
#include "compare/report.h"
#include "interrupt.h"
#include "number_checks.h"
#include "path_lengths.h"
#include "render/defaults.h"
#include "scene_options.h"

namespace etendue {
namespace {

struct CompareCommand {
    std::vector<std::string> scenes, methods, references;
    SceneOptions reading;
    std::string paths = "all", lengths = "1..", reference_method, sampler = "sobol",
                report = "out/compare", kept_references = "out/references";
    double seconds = 0, reference_seconds = 0;
    uint64_t spp = 0, reference_spp = 0, seed = 0;
    int runs = 1, threads = 0, technique_depth = 5;
    bool quiet = false;

    void run() const;

private:
    void check() const;
    PathSelection shown() const;
    CompareSettings settings(const Scene& scene) const;
    RenderSettings reference_settings(const Scene& scene,
                                      const std::vector<MethodSpec>& specs) const;
};

/// A status line on stderr, rewritten at most ten times per second. Prints nothing if stderr is not a terminal.
class StatusLine {
public:
    explicit StatusLine(bool quiet) : active_(!quiet && isatty(STDERR_FILENO)) {}
    ~StatusLine() { clear(); }
    void show(const std::string& text) {
        const auto now = Clock::now();
        if (!active_ || now - last_ < std::chrono::milliseconds(100)) return;
        last_ = now;
        fmt::print(stderr, "\r{}\033[K", text);
    }
    void clear() const {
        if (active_) fmt::print(stderr, "\r\033[K");
    }

private:
    using Clock = std::chrono::steady_clock;
    bool active_;
    Clock::time_point last_;
};

void CompareCommand::check() const {
    if (seconds > 0 && spp > 0)
        throw std::runtime_error(
            "--time and --spp exclude each other: compare at equal time or at equal samples");
    if (!(seconds > 0) && spp == 0)
        throw std::runtime_error("expected --time or --spp, the limit of each method");
    if (!references.empty() && references.size() != scenes.size())
        throw std::runtime_error(
            fmt::format("--reference needs one image per scene, but has {} for {} scenes",
                        references.size(), scenes.size()));
    if (!references.empty() &&
        (reference_seconds > 0 || reference_spp > 0 || !reference_method.empty()))
        throw std::runtime_error("--reference excludes --reference-time, --reference-spp and "
                                 "--reference-method, which apply to rendered references");
    if (std::filesystem::exists(report) && !std::filesystem::is_directory(report))
        throw std::runtime_error(fmt::format("--report: {} is not a folder", report));
}

PathSelection CompareCommand::shown() const {
    PathSelection p = parse_lengths(lengths);
    p.inner_only = paths == "inner";
    return p;
}

CompareSettings CompareCommand::settings(const Scene& scene) const {
    CompareSettings s;
    for (const std::string& m : methods) s.methods.push_back({m, choose_integrator(scene, m)});
    s.sampler = parse_sampler(sampler);
    s.seed = seed;
    s.threads = threads;
    if (seconds > 0) s.limits.seconds = seconds;
    if (spp > 0) s.limits.spp = spp;
    s.runs = runs;
    s.shown = shown();
    s.technique_depth = technique_depth;
    return s;
}

RenderSettings CompareCommand::reference_settings(const Scene& scene,
                                                  const std::vector<MethodSpec>& specs) const {
    RenderSettings s;
    s.integrator = reference_method.empty() ? reference_integrator(scene, specs)
                                            : choose_integrator(scene, reference_method);
    s.sampler = parse_sampler(sampler);
    s.threads = threads;
    s.shown = shown();
    if (reference_seconds > 0) s.seconds = reference_seconds;
    if (reference_spp > 0) s.spp = reference_spp;
    if (!s.seconds && !s.spp)
        static_cast<RenderLimits&>(s) =
            reference_limits({.spp = spp > 0 ? std::optional(spp) : std::nullopt,
                              .seconds = seconds > 0 ? std::optional(seconds) : std::nullopt,
                              .error = {}});
    return s;
}

void print_summary(const Comparison& c) {
    fmt::print(stderr, "{}\n  {:<28} {:>8} {:>9} {:>10} {:>10} {:>8} {:>8} {:>11}\n", c.scene_file,
               "method", "spp", "time", "relMSE", "trimmed", "FLIP", "mean", "efficiency");
    const std::vector<MethodSummary> summaries = summarize(c);
    for (size_t i = 0; i < summaries.size(); ++i) {
        const MethodSummary& s = summaries[i];
        fmt::print(stderr,
                   "  {:<28} {:>8.0f} {:>7.2f} s {:>10.3e} {:>10.3e} {:>8.4f} {:>8.4f} {:>11}\n",
                   c.methods[i].name(), s.spp, s.seconds, s.rel_mse, s.rel_mse_trimmed,
                   c.methods[i].flip, s.mean_ratio.value,
                   s.efficiency ? fmt::format("{:.3g}", s.efficiency->value) : "unknown");
    }
}

void print_warnings(const Comparison& c) {
    const auto print = [&](const std::string& name, const std::vector<std::string>& warnings) {
        for (const std::string& w : warnings)
            fmt::print(stderr, "warning: {}: {}: {}\n", c.scene_file, name, w);
    };
    print("reference", c.reference.warnings);
    for (const Method& m : c.methods) print(m.name(), m.warnings());
}

void CompareCommand::run() const {
    check();
    std::vector<Comparison> comparisons;
    const std::atomic<bool>& interrupted = catch_interrupts();
    for (size_t i = 0; i < scenes.size() && !interrupted.load(); ++i) {
        SceneOptions options = reading;
        options.file = scenes[i];
        options.threads = threads;
        const SceneDescription description = read_scene(options);
        const Scene scene = build_scene(description, options);
        for (const std::string& w : scene.warnings()) fmt::print(stderr, "warning: {}\n", w);
        const CompareSettings s = settings(scene);
        check_methods(s.methods);

        StatusLine status(quiet);
        std::optional<Reference> reference;
        if (!references.empty()) {
            reference = read_reference(references[i], scene.film());
        } else {
            const RenderSettings how = reference_settings(scene, s.methods);
            if (s.shown.inner_only) check_inner_paths(scene, s.methods, how.integrator);
            for (const std::string& w : depth_warnings(s.methods, how.integrator))
                fmt::print(stderr, "warning: {}\n", w);
            reference = make_reference(
                scene,
                {how, kept_references, scene_fingerprint(description), program_fingerprint()},
                [&](const Progress& p) {
                    status.show(fmt::format("{}: reference, {} spp, {:.1f} s", scenes[i], p.passes,
                                            p.seconds));
                },
                interrupted);
            if (!reference) break;
        }
        comparisons.push_back(compare(
            scene, *reference, s,
            [&](const std::string& text) { status.show(scenes[i] + ": " + text); }, interrupted));
        status.clear();
        print_warnings(comparisons.back());
        if (!quiet) print_summary(comparisons.back());
    }
    if (comparisons.empty())
        throw std::runtime_error("interrupted before the first comparison: nothing was written");
    write_report(comparisons, {report, ETENDUE_VERSION});
    if (!quiet)
        fmt::print(stderr, "{}\n", (std::filesystem::path(report) / "report.html").string());
}

}  // namespace

void add_compare_command(CLI::App& app) {
    auto command = std::make_shared<CompareCommand>();
    CLI::App& c = *app.add_subcommand(
        "compare", "Compare methods at equal time or equal samples, and write a report");
    c.add_option("SCENE", command->scenes, "Scene files (.xml, .pbrt, .gltf, .glb)")->required();
    command->reading.add_reading_options(c);
    c.add_option("-m,--methods", command->methods,
                 "Integrators with parameters: path 'bdpt:max_depth=8'; efficiencies are relative "
                 "to the first")
        ->required();
    c.add_option("--time", command->seconds, "Seconds that each method renders")
        ->check(must_be_above_0);
    c.add_option("--spp", command->spp, "Samples per pixel of each method, instead of --time")
        ->check(must_be_above_0);
    c.add_option("--runs", command->runs, "Independent runs, with consecutive seeds")
        ->capture_default_str()
        ->check(CLI::Range(1, 10000));
    c.add_option("--paths", command->paths,
                 "Paths shown in the images: all, or inner, those that join two sub-paths inside "
                 "the scene (s >= 1 and t >= 2)")
        ->capture_default_str()
        ->check(CLI::IsMember({"all", "inner"}));
    c.add_option("--lengths", command->lengths,
                 "Path lengths shown in the images, in edges: 3..5, 4..4, or 4.. without a limit")
        ->capture_default_str();
    c.add_option("--reference", command->references, "Reference images, one per scene");
    c.add_option("--reference-time", command->reference_seconds,
                 "Seconds to render the reference (default: 10 times --time)")
        ->check(must_be_above_0);
    c.add_option("--reference-spp", command->reference_spp,
                 "Samples per pixel of the reference (default: 16 times --spp)")
        ->check(must_be_above_0);
    c.add_option("--reference-method", command->reference_method,
                 "Integrator of the reference (default: bdpt)");
    c.add_option("--references", command->kept_references,
                 "Folder in which rendered references are stored")
        ->capture_default_str();
    c.add_option("--report", command->report, "Folder for the report")->capture_default_str();
    c.add_option("--techniques-max-depth", command->technique_depth,
                 "Longest path with technique images, in edges; 0: none")
        ->capture_default_str()
        ->check(CLI::Range(0, 16));
    c.add_option("--seed", command->seed, "Seed of the first run")->capture_default_str();
    c.add_option("--sampler", command->sampler, "independent or sobol")->capture_default_str();
    c.add_option("--threads", command->threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
