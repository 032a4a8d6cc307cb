#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <new>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "image/image_io.h"
#include "interrupt.h"
#include "json_text.h"
#include "messages.h"
#include "number_checks.h"
#include "preview.h"
#include "render/aov.h"
#include "render/defaults.h"
#include "render/render_report.h"
#include "render/renderer.h"
#include "render/scene_integrator.h"
#include "render/warnings.h"
#include "scene_options.h"
#include "system/available_memory.h"
#include "system/output_file.h"

namespace etendue {
namespace {

struct RenderCommand {
    SceneOptions scene;
    std::string output = "out.exr", integrator, sampler,
                filter_mode = etendue::to_string(etendue::RenderSettings().filter_mode), techniques,
                preview, stats;
    std::vector<std::string> aovs;
    uint64_t seed = 0, spp = 0;
    double seconds = 0, error = 0;
    unsigned grace = 20;
    int threads = 0, technique_depth = 6;
    bool quiet = false;

    void run() const;

private:
    RenderSettings settings_for(const Scene& scene) const;
    /// Checks that need no scene.
    void check_options() const;
    /// Checks before rendering that all outputs can be written; creates missing folders.
    void check_outputs() const;
    /// Writes as much as possible. Returns what could not be written, in words.
    std::vector<std::string> write_outputs(const Renderer& renderer, const Scene& scene,
                                           const std::vector<AovImage>& layers,
                                           const nlohmann::json& report) const;
    /// Writes the image elsewhere if it cannot be written to `output`.
    void write_image_somewhere(const Image& image, std::vector<std::string>& failures) const;
};

std::string format_seconds(double s) {
    if (s < 100) return fmt::format("{:.1f} s", s);
    const long t = std::lround(s);
    return t < 3600 ? fmt::format("{}:{:02}", t / 60, t % 60)
                    : fmt::format("{}:{:02}:{:02}", t / 3600, t / 60 % 60, t % 60);
}

/// Progress on stderr: on a terminal one line that is rewritten, otherwise new lines at growing intervals.
class ProgressLine {
public:
    explicit ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO)) {}
    ~ProgressLine() {
        if (written_ && terminal_) std::fputc('\n', stderr);
    }
    void show(const Progress& p) {
        if (quiet_) return;
        const double interval = terminal_ ? 0.1 : std::max(5.0, p.seconds * 0.2);
        if (written_ && p.seconds - last_ < interval && p.fraction.value_or(0) < 1) return;
        last_ = p.seconds;
        written_ = true;
        std::string line = fmt::format("{} spp, {}", p.passes, format_seconds(p.seconds));
        if (p.fraction && *p.fraction > 0)
            line += fmt::format(", {:.0f} %, {} left", 100 * *p.fraction,
                                format_seconds(p.seconds * (1 / *p.fraction - 1)));
        line += fmt::format(", {:.2f} Mrays/s", p.rays_per_second * 1e-6);
        if (const ErrorEstimate& e = error_.update(p); e.valid)
            line += fmt::format(", relative error {:.4f}", e.relative_rms);
        if (terminal_)
            std::fprintf(stderr, "\r%s\033[K", line.c_str());
        else
            std::fprintf(stderr, "%s\n", line.c_str());
        std::fflush(stderr);
    }

private:
    bool quiet_, terminal_, written_ = false;
    double last_ = 0;
    RecentError error_;
};

void write_techniques(const Renderer& r, const Scene& scene, const std::string& folder) {
    for (const auto& t : r.techniques()->images()) {
        const bool is_stored = t.technique.strategy == Strategy::Connect && t.technique.s == 1;
        const std::string stem =
            fmt::format("{}/length{:02}_s{:02}_t{:02}{}", folder, t.technique.vertices() - 1,
                        t.technique.s, t.technique.t, is_stored ? "_stored" : "");
        const auto [w, h] = std::pair{scene.film().crop_width, scene.film().crop_height};
        write_image(stem + "_weighted.exr", rgb_image(w, h, t.weighted));
        write_image(stem + "_unweighted.exr", rgb_image(w, h, t.unweighted));
    }
}

void RenderCommand::check_options() const {
    check_limits({.spp = spp, .seconds = {}, .error = {}});
    check_image_extension(output);
    const auto folder = std::filesystem::path(output).parent_path();
    if (!folder.empty() && std::filesystem::exists(folder) &&
        !std::filesystem::is_directory(folder))
        throw std::runtime_error(fmt::format("{}: {} is not a folder", output, folder.string()));
    try {
        check_aovs(aovs);
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(fmt::format("--aov: {}", e.what()));
    }
}

void RenderCommand::check_outputs() const {
    OutputFile::check(output);
    if (!stats.empty()) OutputFile::check(stats);
    if (!techniques.empty()) OutputFile::check(techniques + "/length01_s00_t02_weighted.exr");
}

RenderSettings RenderCommand::settings_for(const Scene& s) const {
    RenderSettings settings;
    settings.integrator = choose_integrator(s, integrator);
    settings.sampler = parse_sampler(sampler);
    const auto mode = etendue::filter_mode(filter_mode);
    if (!mode)
        throw std::runtime_error(
            fmt::format("--filter-mode must be spread or sample, but is \"{}\"", filter_mode));
    settings.filter_mode = *mode;
    settings.seed = seed;
    settings.threads = threads;
    if (spp > 0) settings.spp = spp;
    if (seconds > 0) settings.seconds = seconds;
    if (error > 0) settings.error = error;
    set_default_limit(settings, s);
    if (!techniques.empty()) settings.technique_depth = technique_depth;
    return settings;
}

std::unique_ptr<Renderer> make_renderer(const Scene& s, const RenderSettings& settings) try {
    return std::make_unique<Renderer>(s, settings);
} catch (const std::bad_alloc&) {
    throw std::runtime_error(
        fmt::format("not enough memory for an image of {} x {} pixels; render it in crops (--crop)",
                    s.film().crop_width, s.film().crop_height));
}

/// Calls `task`. Adds the reason to `failures` if it fails.
template <class Task>
bool attempt(std::vector<std::string>& failures, const Task& task) {
    try {
        task();
        return true;
    } catch (const std::bad_alloc&) {
        failures.push_back("not enough memory");
    } catch (const std::exception& e) {
        failures.push_back(e.what());
    }
    return false;
}

void RenderCommand::write_image_somewhere(const Image& image,
                                          std::vector<std::string>& failures) const {
    namespace fs = std::filesystem;
    if (attempt(failures, [&] { write_image(output, image); })) return;
    const std::string name =
        fmt::format("etendue-{}{}", ::getpid(), fs::path(output).extension().string());
    std::error_code error;
    for (const fs::path& folder : {fs::current_path(error), fs::temp_directory_path(error)}) {
        const fs::path file = folder / name;
        std::vector<std::string> ignored;
        if (folder.empty() || fs::exists(file, error)) continue;
        if (!attempt(ignored, [&] { write_image(file.string(), image); })) continue;
        failures.back() += fmt::format("; the image is in {}", file.string());
        return;
    }
}

std::vector<std::string> RenderCommand::write_outputs(const Renderer& renderer, const Scene& s,
                                                      const std::vector<AovImage>& layers,
                                                      const nlohmann::json& report) const {
    std::vector<std::string> failures;
    const bool has_variance = std::find(aovs.begin(), aovs.end(), "variance") != aovs.end();
    const bool has_layers = has_variance || !layers.empty();
    const auto write_layers = [&] {
        write_image(output, image_with_layers(renderer, s, layers, has_variance, report));
    };
    // The image alone needs the least memory and space. The one with layers replaces it, except in devices and pipes.
    std::error_code error;
    const bool is_in_place =
        std::filesystem::exists(output, error) && !std::filesystem::is_regular_file(output, error);
    if (is_in_place && has_layers)
        attempt(failures, write_layers);
    else if (attempt(failures,
                     [&] {
                         write_image_somewhere(image_with_layers(renderer, s, {}, false, report),
                                               failures);
                     }) &&
             failures.empty() && has_layers && !attempt(failures, write_layers))
        failures.back() += fmt::format("; {} has the image without further layers", output);
    if (!techniques.empty()) attempt(failures, [&] { write_techniques(renderer, s, techniques); });
    if (!stats.empty()) attempt(failures, [&] { write_file(stats, json_text(report)); });
    return failures;
}

void RenderCommand::run() const {
    check_options();
    SceneOptions loading = scene;
    loading.threads = threads;
    const Scene s = load_scene(loading);
    print_warnings(warnings_of(s, integrator));
    const RenderSettings settings = settings_for(s);
    if (settings.technique_depth > 0 && !quiet)
        message("technique images of paths up to {} edges: {:.0f} MiB\n", technique_depth,
                double(TechniqueImages::memory_bytes(s.film().pixel_count(), technique_depth)) /
                    (1 << 20));
    const std::unique_ptr<Renderer> owned = make_renderer(s, settings);
    Renderer& renderer = *owned;
    print_warnings(
        memory_warnings(s, settings.integrator, renderer.light_paths(), available_memory()));
    check_outputs();
    // Before the passes, so that nothing that can fail stands between them and their image.
    const std::vector<AovImage> layers = render_aovs(s, aovs, kAovSamples, seed, threads);

    const Interrupts interrupts = catch_interrupts(grace);
    std::unique_ptr<Preview> viewer;
    if (!preview.empty())
        viewer =
            std::make_unique<Preview>(preview, output, s.film().crop_width, s.film().crop_height);

    PassLog log;
    std::string stopped_by, failure;
    try {
        ProgressLine line(quiet);
        stopped_by = to_string(renderer.run(
            [&](const Progress& p) {
                line.show(p);
                log.add(p.seconds, renderer.stats().pairs);
                if (viewer && !viewer->update(renderer.film(), p.seconds)) viewer.reset();
            },
            interrupts.stop, interrupts.drop));
    } catch (const std::exception& e) {
        // The passes before this one are complete and can be written.
        if (renderer.film().passes() == 0) throw;
        stopped_by = "failure";
        failure = dynamic_cast<const std::bad_alloc*>(&e) ? "not enough memory" : e.what();
    }
    const uint64_t passes = renderer.film().passes();
    if (passes == 0) throw std::runtime_error("interrupted in the first pass: nothing was written");

    nlohmann::json report = to_json(renderer, s, settings, stopped_by, log);
    if (!failure.empty()) report["failure"] = failure;
    std::vector<std::string> failures = write_outputs(renderer, s, layers, report);

    print_warnings(warnings(renderer.stats()));
    if (!failure.empty())
        failures.insert(failures.begin(),
                        fmt::format("pass {} failed: {}; {} contains the {} before it", passes + 1,
                                    failure, output,
                                    passes == 1 ? "pass" : fmt::format("{} passes", passes)));
    if (!failures.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(failures, "; ")));
    if (quiet) return;
    const ErrorEstimate e = renderer.film().error();
    message("{}: {} spp in {}, {:.3f} Msamples/s, {:.2f} Mrays/s{}\n", output, passes,
            format_seconds(renderer.seconds()), report["samples_per_second"].get<double>() * 1e-6,
            report["rays_per_second"].get<double>() * 1e-6,
            e.valid ? fmt::format(", relative error {:.4f} (95 %: {:.4f} to {:.4f})",
                                  e.relative_rms, e.low, e.high)
                    : "");
}

}  // namespace

void add_render_command(CLI::App& app) {
    auto command = std::make_shared<RenderCommand>();
    CLI::App& c = *app.add_subcommand("render", "Render a scene to an image");
    command->scene.add_to(c);
    c.add_option("-o,--output", command->output, "Image to write: .exr, .pfm, .hdr or .png")
        ->capture_default_str();
    c.add_option(
        "-i,--integrator", command->integrator,
        "Integrator with parameters: bdpt or bdpt:max_depth=12,rr_depth=5 (default: the scene's)");
    c.add_option("--spp", command->spp, "Samples per pixel")->check(must_be_above_0);
    c.add_option("--time", command->seconds, "Seconds to render; may be exceeded by half a pass")
        ->check(must_be_above_0);
    c.add_option("--error", command->error,
                 "Stop at this estimated relative RMS error of the image, e.g. 0.01")
        ->check(must_be_above_0);
    c.add_option("--grace", command->grace,
                 "Seconds that the current pass may continue after Ctrl-C or SIGTERM")
        ->capture_default_str()
        ->check(CLI::Range(0, 86400));
    c.add_option("--seed", command->seed, "Seed of all random numbers")->capture_default_str();
    c.add_option(
         "--filter-mode", command->filter_mode,
         "spread: an eye path contributes to all pixels that the filter reaches; sample: to "
         "its own pixel, with a film point drawn from the filter")
        ->capture_default_str();
    add_sampler_option(c, command->sampler, "; with sobol the error estimate is an upper bound");
    c.add_option("--threads", command->threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_option("--aov", command->aovs,
                 "Layers to add: albedo, normal, depth, position, uv, variance")
        ->delimiter(',');
    c.add_option("--techniques", command->techniques,
                 "Folder for the images of each technique (s,t), weighted and unweighted");
    c.add_option("--techniques-max-depth", command->technique_depth,
                 "Longest path with technique images, in edges")
        ->capture_default_str()
        ->check(CLI::Range(1, 64));
    c.add_option("--preview", command->preview,
                 "Show the image during rendering: tev, or tev://host:port");
    c.add_option("--stats", command->stats, "Write statistics to this JSON file");
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
