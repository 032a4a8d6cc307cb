#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "image/atomic_file.h"
#include "image/image_io.h"
#include "interrupt.h"
#include "preview.h"
#include "render/aov.h"
#include "render/renderer.h"
#include "scene_options.h"

namespace etendue {
namespace {

struct RenderCommand {
    SceneOptions scene;
    std::string output = "out.exr", integrator, sampler = "sobol", techniques, preview, stats;
    std::vector<std::string> aovs;
    uint64_t seed = 0, spp = 0;
    double seconds = 0, error = 0;
    int threads = 0, technique_depth = 6;
    bool quiet = false;

    void run() const;
};

std::string format_seconds(double s) {
    if (s < 100) return fmt::format("{:.1f} s", s);
    const long t = std::lround(s);
    return t < 3600 ? fmt::format("{}:{:02}", t / 60, t % 60)
                    : fmt::format("{}:{:02}:{:02}", t / 3600, t / 60 % 60, t % 60);
}

/// One line that is rewritten on a terminal; in a log a line now and then.
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
        if (p.error.valid) line += fmt::format(", relative error {:.4f}", p.error.relative_rms);
        if (terminal_)
            std::fprintf(stderr, "\r%s\033[K", line.c_str());
        else
            std::fprintf(stderr, "%s\n", line.c_str());
        std::fflush(stderr);
    }

private:
    bool quiet_, terminal_, written_ = false;
    double last_ = 0;
};

nlohmann::json to_json(const Renderer& r, const Scene& scene, const RenderSettings& settings,
                       StopReason reason) {
    const RenderStats& s = r.stats();
    const ErrorEstimate e = r.film().error();
    const Film::MeanEstimate mean = r.film().mean_luminance();
    nlohmann::json j{
        {"scene", scene.file()},
        {"integrator", settings.integrator.to_string()},
        {"estimator", to_string(r.integrator().estimator())},
        {"seed", settings.seed},
        {"width", scene.film().crop_width},
        {"height", scene.film().crop_height},
        {"spp", r.film().passes()},
        {"seconds", r.seconds()},
        {"stopped_by", to_string(reason)},
        {"samples_per_second",
         double(r.film().passes()) * double(scene.film().pixel_count()) / r.seconds()},
        {"rays_per_second", double(s.rays()) / r.seconds()},
        {"walk_rays", s.walk_rays},
        {"shadow_rays", s.shadow_rays},
        {"visible_shadow_rays", s.visible},
        {"pairs", s.pairs},
        {"visible_pairs", s.visible_pairs},
        {"trials", s.trials},
        {"trial_rays", s.trial_rays},
        {"pairs_by_trials", s.pairs_by_trials},
        {"bounds_exceeded", s.bounds_exceeded},
        {"runaways", s.runaways},
        {"eye_paths", s.eye_paths},
        {"light_paths", s.light_paths},
        {"vertices", s.vertices},
        {"rejected_contributions", s.rejected + r.film().rejected()},
        {"mean_luminance", mean.mean},
        {"mean_luminance_standard_error", mean.standard_error},
    };
    const PhaseSeconds& p = s.phases;
    j["phase_seconds"] = {{"light_paths", p.light_paths},
                          {"records", p.records},
                          {"eye_paths", p.eye_paths - p.connections},
                          {"connections", p.connections}};
    for (const auto& [name, value] : r.integrator().figures()) j[name] = value;
    if (e.valid)
        j["relative_error"] = {
            {"estimate", e.relative_rms}, {"low_95", e.low}, {"high_95", e.high}};
    return j;
}

void check_aovs(const std::vector<std::string>& names) {
    std::vector<std::string> known;
    for (const AovInfo& a : aov_registry()) known.push_back(a.name);
    for (const std::string& n : names)
        if (std::find(known.begin(), known.end(), n) == known.end())
            throw std::runtime_error(fmt::format("--aov: there is no \"{}\" (there are: {})", n,
                                                 fmt::join(known, ", ")));
}

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

void RenderCommand::run() const {
    check_image_extension(output);
    check_aovs(aovs);
    const auto folder = std::filesystem::path(output).parent_path();
    if (!folder.empty() && std::filesystem::exists(folder) &&
        !std::filesystem::is_directory(folder))
        throw std::runtime_error(fmt::format("{}: {} is not a folder", output, folder.string()));

    const Scene s = load_scene(scene);
    for (const std::string& w : s.warnings()) fmt::print(stderr, "warning: {}\n", w);

    RenderSettings settings;
    settings.integrator = choose_integrator(s, integrator);
    settings.sampler = parse_sampler(sampler);
    settings.seed = seed;
    settings.threads = threads;
    if (spp > 0) settings.spp = spp;
    if (seconds > 0) settings.seconds = seconds;
    if (error > 0) settings.error = error;
    if (!settings.spp && !settings.seconds && !settings.error)
        settings.spp = s.defaults().spp > 0 ? uint64_t(s.defaults().spp) : 64;
    if (!techniques.empty()) {
        settings.technique_depth = technique_depth;
        if (!quiet)
            fmt::print(
                stderr, "technique images of paths up to {} edges: {:.0f} MiB\n", technique_depth,
                double(TechniqueImages::memory_bytes(s.film().pixel_count(), technique_depth)) /
                    (1 << 20));
    }

    Renderer renderer(s, settings);
    const std::atomic<bool>& interrupted = catch_interrupts();
    std::unique_ptr<Preview> viewer;
    if (!preview.empty())
        viewer =
            std::make_unique<Preview>(preview, output, s.film().crop_width, s.film().crop_height);

    StopReason reason;
    std::vector<double> pass_seconds;
    std::vector<uint64_t> pass_pairs;
    double seconds_before = 0;
    uint64_t pairs_before = 0;
    {
        ProgressLine line(quiet);
        reason = renderer.run(
            [&](const Progress& p) {
                line.show(p);
                pass_seconds.push_back(p.seconds - seconds_before);
                pass_pairs.push_back(renderer.stats().pairs - pairs_before);
                seconds_before = p.seconds;
                pairs_before = renderer.stats().pairs;
                if (viewer) viewer->update(renderer.film(), p.seconds);
            },
            interrupted);
    }

    nlohmann::json report = to_json(renderer, s, settings, reason);
    report["pass_seconds"] = pass_seconds;
    report["pass_pairs"] = pass_pairs;
    Image image = rgb_image(s.film().crop_width, s.film().crop_height, renderer.film().image());
    for (const auto& [key, value] : report.items())
        if (value.is_string())
            image.attributes["etendue." + key] = value.get<std::string>();
        else if (value.is_number())
            image.attributes["etendue." + key] = value.get<double>();
    image.attributes["etendue.version"] = std::string(ETENDUE_VERSION);
    for (const AovImage& a : render_aovs(s, aovs, 16, seed, threads))
        add_rgb_layer(image, image.width, image.height, a.name, a.pixels);
    if (std::find(aovs.begin(), aovs.end(), "variance") != aovs.end())
        add_rgb_layer(image, image.width, image.height, "variance", renderer.film().variance());
    write_image(output, image);
    if (!techniques.empty()) write_techniques(renderer, s, techniques);
    if (!stats.empty()) write_file_atomically(stats, report.dump(2) + "\n");

    if (!quiet) {
        const ErrorEstimate e = renderer.film().error();
        fmt::print(stderr, "{}: {} spp in {}, {:.3f} Msamples/s, {:.2f} Mrays/s{}\n", output,
                   renderer.film().passes(), format_seconds(renderer.seconds()),
                   report["samples_per_second"].get<double>() * 1e-6,
                   report["rays_per_second"].get<double>() * 1e-6,
                   e.valid ? fmt::format(", relative error {:.4f} (95 %: {:.4f} to {:.4f})",
                                         e.relative_rms, e.low, e.high)
                           : "");
        if (const auto bad = report["rejected_contributions"].get<uint64_t>(); bad > 0)
            fmt::print(stderr, "warning: {} contributions were not finite and were left out\n",
                       bad);
    }
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
    c.add_option("--spp", command->spp, "Samples per pixel")->check(CLI::PositiveNumber);
    c.add_option("--time", command->seconds, "Seconds to render, within one pass")
        ->check(CLI::PositiveNumber);
    c.add_option("--error", command->error, "Stop at this relative RMS error of the image")
        ->check(CLI::PositiveNumber);
    c.add_option("--seed", command->seed, "Seed of all random numbers")->capture_default_str();
    c.add_option("--sampler", command->sampler,
                 "independent or sobol; with sobol the error estimate is an upper one")
        ->capture_default_str();
    c.add_option("--threads", command->threads, "Number of threads; 0: all")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_option("--aov", command->aovs,
                 "Layers to add: albedo, normal, depth, position, uv, variance")
        ->delimiter(',');
    c.add_option("--techniques", command->techniques,
                 "Folder for an image per technique (s,t), weighted and unweighted");
    c.add_option("--techniques-max-depth", command->technique_depth,
                 "Longest path with technique images, edges")
        ->capture_default_str()
        ->check(CLI::Range(1, 64));
    c.add_option("--preview", command->preview,
                 "Show the image while it renders: tev or tev://host:port");
    c.add_option("--stats", command->stats, "Write statistics to this JSON file");
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
