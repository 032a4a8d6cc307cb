#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "compare/comparison.h"
#include "compare/default_reference.h"
#include "compare/report.h"
#include "interrupt.h"
#include "messages.h"
#include "number_checks.h"
#include "option_groups.h"
#include "path_lengths.h"
#include "render/render_request.h"
#include "scene_options.h"
#include "system/failure.h"
#include "system/output_file.h"
#include "usage_error.h"

namespace etendue {
namespace {

struct CompareCommand {
    std::vector<std::string> scenes, methods, images, references;
    SceneOptions reading;
    std::string paths = "all", lengths = "1..", reference_method, report = "out/compare",
                kept_references = "out/references";
    SamplerKind sampler = CompareSettings().sampler;
    double seconds = 0, reference_seconds = 0;
    uint64_t spp = 0, reference_spp = 0, seed = 0;
    int runs = 1, threads = 0, technique_depth = 5;
    bool quiet = false;

    void run() const;

private:
    struct Job;
    Job load(size_t scene) const;
    /// Empty if it was interrupted before the methods began.
    std::optional<Comparison> compare_scene(size_t scene,
                                            const std::atomic<bool>& interrupted) const;
    void check() const;
    /// Whether the report can be written.
    void check_report() const;
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
        message("\r{}\033[K", text);
    }
    void clear() const {
        if (active_) message("\r\033[K");
    }

private:
    using Clock = std::chrono::steady_clock;
    bool active_;
    Clock::time_point last_;
};

void CompareCommand::check() const {
    if (seconds > 0 && spp > 0)
        throw UsageError(
            "--time and --spp exclude each other: compare at equal time or at equal samples");
    if (!(seconds > 0) && spp == 0)
        throw UsageError("expected --time or --spp, the limit of each method");
    if (!references.empty() && references.size() != scenes.size())
        throw UsageError(
            fmt::format("--reference needs one image per scene, but has {} for {} scenes",
                        references.size(), scenes.size()));
    if (!references.empty() &&
        (reference_seconds > 0 || reference_spp > 0 || !reference_method.empty()))
        throw UsageError("--reference excludes --reference-time, --reference-spp and "
                         "--reference-method, which apply to rendered references");
    if (!images.empty() && scenes.size() > 1)
        throw UsageError("--images are those of one scene, but several are given");
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
    s.sampler = sampler;
    s.seed = seed;
    s.threads = threads;
    if (seconds > 0) s.limits.seconds = seconds;
    if (spp > 0) s.limits.spp = spp;
    s.runs = runs;
    s.shown = shown();
    s.technique_depth = technique_depth;
    for (const std::string& given : images) {
        const size_t equals = given.find('=');
        if (equals == std::string::npos || equals == 0)
            throw UsageError(
                fmt::format("--images must have the form NAME=FOLDER, but is \"{}\"", given));
        s.images.push_back(
            find_timed_images(given.substr(0, equals), given.substr(equals + 1), scene.film()));
    }
    return s;
}

RenderSettings CompareCommand::reference_settings(const Scene& scene,
                                                  const std::vector<MethodSpec>& specs) const {
    RenderSettings s;
    s.integrator = reference_method.empty() ? reference_integrator(scene, specs)
                                            : choose_integrator(scene, reference_method);
    s.sampler = sampler;
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
    // Where it cannot be written, main() says so, after the report has been.
    const auto print = [](const std::string& text) {
        std::fwrite(text.data(), 1, text.size(), stdout);
    };
    print(fmt::format("{}\n  {:<28} {:>8} {:>9} {:>10} {:>10} {:>8} {:>8} {:>11}\n", c.scene_file,
                      "method", "spp", "time", "relMSE", "trimmed", "FLIP", "mean", "efficiency"));
    const std::vector<MethodSummary> summaries = summarize(c);
    for (size_t i = 0; i < summaries.size(); ++i) {
        const MethodSummary& s = summaries[i];
        print(fmt::format(
            "  {:<28} {:>8.0f} {:>7.2f} s {:>10.3e} {:>10.3e} {:>8.4f} {:>8.4f} {:>11}\n",
            c.methods[i].name(), s.spp, s.seconds, s.rel_mse, s.rel_mse_trimmed, c.methods[i].flip,
            s.mean_ratio.value,
            s.efficiency ? fmt::format("{:.3g}", s.efficiency->value) : "unknown"));
    }
    // The program may end while the next scene is loaded.
    std::fflush(stdout);
}

void print_warnings_of(const Comparison& c) {
    for (const std::string& f : c.failures) message("warning: {}: {}\n", c.scene_file, f);
    const auto print = [&](const std::string& name, const std::vector<std::string>& warnings) {
        for (const std::string& w : warnings)
            message("warning: {}: {}: {}\n", c.scene_file, name, w);
    };
    print("reference", c.reference.warnings);
    for (const Method& m : c.methods) print(m.name(), m.warnings());
}

/// A scene with the settings of its comparison.
struct CompareCommand::Job {
    SceneDescription description;
    Scene scene;
    CompareSettings settings;
};

CompareCommand::Job CompareCommand::load(size_t i) const {
    // The comparisons before this one are written.
    const EndsAtOnce ends_at_once;
    SceneOptions options = reading;
    options.file = scenes[i];
    options.threads = threads;
    SceneDescription description = read_scene(options);
    Scene scene = build_scene(description, options);
    CompareSettings s = settings(scene);
    check_methods(s);
    if (references.empty()) {
        const RenderSettings how = reference_settings(scene, s.methods);
        if (s.shown.inner_only) check_inner_paths(scene, s.methods, how.integrator);
    }
    return {std::move(description), std::move(scene), std::move(s)};
}

void CompareCommand::check_report() const {
    OutputFile::check((std::filesystem::path(report) / "report.html").string());
}

std::optional<Comparison>
CompareCommand::compare_scene(size_t i, const std::atomic<bool>& interrupted) const {
    const Job job = load(i);
    print_warnings(job.scene.warnings());
    StatusLine status(quiet);
    std::optional<Reference> reference;
    if (!references.empty()) {
        reference = read_reference(references[i], job.scene.film());
        check_report();
    } else {
        check_report();
        const RenderSettings how = reference_settings(job.scene, job.settings.methods);
        print_warnings(depth_warnings(job.settings.methods, how.integrator));
        reference = make_reference(
            job.scene,
            {how, kept_references, scene_fingerprint(job.description), program_fingerprint()},
            [&](const Progress& p) {
                status.show(
                    fmt::format("{}: reference, {} spp, {:.1f} s", scenes[i], p.passes, p.seconds));
            },
            interrupted);
        if (!reference) return {};
    }
    return compare(
        job.scene, *reference, job.settings,
        [&](const std::string& text) { status.show(scenes[i] + ": " + text); }, interrupted);
}

void CompareCommand::run() const {
    check();
    // What is wrong with a scene or an image is found before the first one is rendered.
    if (scenes.size() > 1)
        for (size_t i = 0; i < scenes.size(); ++i) {
            const Job job = load(i);
            if (!references.empty()) read_reference(references[i], job.scene.film());
        }
    ReportWriter writer({report, ETENDUE_VERSION});
    const std::atomic<bool>& interrupted = catch_interrupts();
    size_t compared = 0, failures = 0;
    for (size_t i = 0; i < scenes.size() && !interrupted.load(); ++i) {
        // Each scene is written when it is finished, and does not depend on those after it.
        try {
            const std::optional<Comparison> comparison = compare_scene(i, interrupted);
            if (!comparison) break;
            print_warnings_of(*comparison);
            if (!quiet) print_summary(*comparison);
            failures += comparison->failures.size();
            writer.add(*comparison);
            ++compared;
        } catch (...) {
            if (scenes.size() == 1) throw;
            const std::string why = caught();
            ++failures;
            writer.add_failure(scenes[i], why);
            message("warning: {}: {}\n", scenes[i], why);
        }
        if (compared > 0) writer.write();
    }
    if (compared == 0 && failures == 0)
        throw std::runtime_error("interrupted before the first comparison: nothing was written");
    if (compared > 0 && !quiet)
        message("{}\n", (std::filesystem::path(report) / "report.html").string());
    if (failures > 0)
        throw std::runtime_error(
            fmt::format("{} of the comparisons failed; the warnings say why", failures));
}

}  // namespace

void add_compare_command(CLI::App& app) {
    auto command = std::make_shared<CompareCommand>();
    CLI::App& c = *app.add_subcommand(
        "compare", "Compare methods at equal time or equal samples, and write a report");
    c.add_option("SCENE", command->scenes, "Scene files (.xml, .pbrt, .gltf, .glb, .usd)")
        ->required();
    c.add_option("-m,--methods", command->methods,
                 "Integrators with parameters: path 'bdpt:max_depth=8'; efficiencies are relative "
                 "to the first")
        ->required();
    c.add_option("--images", command->images,
                 "Images of another program, NAME=FOLDER: .exr or .pfm files whose names end with "
                 "the rendering time, such as seed1-64spp-2.5s.exr; repeatable");
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
    c.add_option("--seed", command->seed, "Seed of the first run")
        ->capture_default_str()
        ->check(must_be_unsigned);
    add_sampler_option(c, command->sampler);
    c.add_option("--threads", command->threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    command->reading.add_reading_options(c);
    set_group(c, kForExperts,
              {"--paths", "--lengths", "--references", "--techniques-max-depth", "--sampler"});
    c.callback([command] { command->run(); });
}

}  // namespace etendue
