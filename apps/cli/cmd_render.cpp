#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <future>
#include <new>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "description/fingerprint.h"
#include "display_options.h"
#include "figures.h"
#include "image/denoiser.h"
#include "image/image_io.h"
#include "interrupt.h"
#include "json_text.h"
#include "messages.h"
#include "number_checks.h"
#include "option_groups.h"
#include "output_checks.h"
#include "preview.h"
#include "render/aov.h"
#include "render/checkpoint.h"
#include "render/method_choice.h"
#include "render/render_report.h"
#include "render/render_request.h"
#include "render/renderer.h"
#include "render/scene_integrator.h"
#include "render/warnings.h"
#include "render/writing_pace.h"
#include "scene_options.h"
#include "system/available_memory.h"
#include "system/descriptor.h"
#include "system/failure.h"
#include "system/memory_limit.h"
#include "system/output_file.h"
#include "system/ranks.h"
#include "system/section_file.h"
#include "technique_files.h"
#include "usage_error.h"

namespace etendue {
namespace {

struct RenderCommand {
    SceneOptions scene;
    RenderRequest request;
    std::string output = "out.exr", techniques, preview, stats, checkpoint, resume, passes;
    std::vector<std::string> aovs;
    DisplayOptions display;
    static constexpr double kCheckpointEvery = 60;
    std::optional<double> checkpoint_every;
    double write_every = 60;
    unsigned grace = 20;
    int technique_depth = 6;
    bool denoise = false, quiet = false;

    void run() const;

private:
    /// What is to be rendered, and its state.
    struct Job {
        Scene scene;
        uint64_t fingerprint = 0;
        RenderSettings settings{};
        std::unique_ptr<Renderer> renderer{};
        Conditions conditions{};
        PassLog log{};
        std::vector<AovImage> layers{};  ///< Of the image, beside those of the renderer.
        std::unique_ptr<Denoiser> denoiser{};
        std::vector<AovImage> guides{};  ///< Of the denoiser.
    };
    std::unique_ptr<Job> make_job(const Ranks& ranks) const;
    void render(Job& job, const Ranks& ranks) const;
    RenderSettings settings_for(const Scene& scene) const;
    /// Where `auto` renders. `earlier`: the choice of the checkpoint from which the rendering goes on; may be empty.
    void choose_method(Job& job, const std::string& earlier) const;
    /// First and number of the passes of --passes; the number is 0 if they are not given.
    std::pair<uint64_t, uint64_t> pass_range() const;
    /// The file in which checkpoints are written; empty if there is none.
    const std::string& checkpoint_file() const {
        return checkpoint.empty() && resume != kAuto ? resume : checkpoint;
    }
    /// The checkpoint from which the rendering goes on, if there is one.
    std::optional<CheckpointFile> earlier_checkpoint() const;
    /// Whether a checkpoint is to be replaced without having been resumed. No other file is replaced by one.
    bool replaces_another_checkpoint() const;
    /// Says which one is to be replaced.
    void warn_of_replaced_checkpoint(const Conditions& conditions) const;
    static constexpr const char* kAuto = "auto";
    /// Checks that need no scene.
    void check_options() const;
    /// Checks before rendering that all outputs can be written; creates missing folders.
    void check_outputs() const;
    /// Writes as much as possible. Returns what could not be written, in words.
    std::vector<std::string> write_outputs(const Renderer& renderer,
                                           const std::vector<AovImage>& layers,
                                           const nlohmann::json& report) const;
    /// The file of --denoise: out.denoised.exr beside out.exr.
    std::string denoised_file() const {
        const std::filesystem::path image = output;
        return std::filesystem::path(image)
            .replace_extension(".denoised" + image.extension().string())
            .string();
    }
    void write_denoised(const Job& job, const nlohmann::json& report) const;
    /// Writes the image elsewhere if it cannot be written to `output`.
    void write_image_somewhere(const ImageRows& image, std::vector<std::string>& failures) const;
    /// Whether the image goes to a device or a pipe, which take it once.
    bool is_in_place() const {
        std::error_code error;
        return std::filesystem::exists(output, error) &&
               !std::filesystem::is_regular_file(output, error);
    }
};

/// When a file that is written beside the passes is due; never if its interval is 0.
class Timer {
public:
    explicit Timer(const WritingPace& pace) : pace_(pace) {}
    bool is_due() const { return pace_.interval > 0 && seconds_since(last_) >= wait_; }
    template <class Task>
    void call(const Task& task) {
        const Clock::time_point begin = Clock::now();
        task();
        last_ = Clock::now();
        const double taken = seconds_since(begin);
        wait_ = pace_.wait_after(taken);
        seconds_ += taken;
        ++calls_;
    }
    int calls() const { return calls_; }
    /// The seconds that all calls took.
    double seconds() const { return seconds_; }

private:
    using Clock = std::chrono::steady_clock;
    static double seconds_since(Clock::time_point t) {
        return std::chrono::duration<double>(Clock::now() - t).count();
    }
    WritingPace pace_;
    double wait_ = pace_.interval, seconds_ = 0;
    int calls_ = 0;
    Clock::time_point last_ = Clock::now();
};

/// Files that become durable while the rendering goes on, one after the other.
class LaterCommit {
public:
    /// After finish().
    void begin(std::unique_ptr<SectionWriter> file) {
        const auto commit =
            std::make_shared<std::packaged_task<void()>>([file = std::move(file)]() mutable {
                // Ends here: a temporary file that could not be committed does not stay until the next checkpoint.
                const std::unique_ptr<SectionWriter> own = std::move(file);
                own->commit();
            });
        result_ = commit->get_future();
        try {
            thread_ = std::jthread([commit] { (*commit)(); });
        } catch (const std::exception&) {  // There can be no further thread.
            (*commit)();
        }
    }
    /// Waits for the file. Throws if it could not be written.
    void finish() {
        if (!result_.valid()) return;
        result_.get();
        ++written_;
    }
    uint64_t written() const { return written_; }

private:
    std::future<void> result_;
    std::jthread thread_;
    uint64_t written_ = 0;
};

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

void RenderCommand::check_options() const {
    const auto [first_pass, count] = pass_range();
    if (count > 0 && request.spp)
        throw UsageError(
            "--passes and --spp exclude each other: --passes says how many passes there are");
    RenderLimits limits = request;
    if (count > 0) limits.spp = count;
    check_limits(limits, first_pass);
    if (resume == kAuto && checkpoint.empty())
        throw UsageError("--resume auto requires --checkpoint, the file to resume from");
    for (const auto& [name, file] : {std::pair{"image", output},
                                     {"denoised image", denoise ? denoised_file() : ""},
                                     {"checkpoint", checkpoint_file()},
                                     {"statistics", stats}}) {
        refuse_same_file("scene", scene.file, name, file);
        if (!request.integrator.empty()) refuse_user_paths(request.integrator, name, file);
        // Further checkpoints may replace it.
        if (resume != kAuto && name != std::string_view("checkpoint"))
            refuse_same_file("checkpoint to resume from", resume, name, file);
    }
    refuse_same_file("image", output, "checkpoint", checkpoint_file());
    refuse_same_file("image", output, "statistics", stats);
    refuse_same_file("checkpoint", checkpoint_file(), "statistics", stats);
    if (denoise) {
        if (is_in_place())
            throw std::runtime_error(fmt::format(
                "--denoise writes a second image beside {}, which must therefore be a file",
                output));
        for (const auto& [name, file] :
             {std::pair{"checkpoint", checkpoint_file()}, {"statistics", stats}})
            refuse_same_file(name, file, "denoised image", denoised_file());
    }
    check_image_extension(output);
    display.check();
    const auto folder = std::filesystem::path(output).parent_path();
    if (!folder.empty() && std::filesystem::exists(folder) &&
        !std::filesystem::is_directory(folder))
        throw std::runtime_error(fmt::format("{}: {} is not a folder", output, folder.string()));
    try {
        check_aovs(aovs);
    } catch (const std::runtime_error& e) {
        throw UsageError(fmt::format("--aov: {}", e.what()));
    }
    if (!aovs.empty() && image_extension(output) != ".exr")
        throw UsageError(
            fmt::format("--aov: {} would have no layers; an .exr file has them", output));
}

void RenderCommand::check_outputs() const {
    OutputFile::check(output);
    if (denoise) OutputFile::check(denoised_file());
    if (!stats.empty()) OutputFile::check(stats);
    if (!checkpoint_file().empty()) OutputFile::check(checkpoint_file());
    if (!techniques.empty()) check_technique_folder(techniques);
}

std::pair<uint64_t, uint64_t> RenderCommand::pass_range() const {
    if (passes.empty()) return {0, 0};
    uint64_t first = 0, end = 0;
    const char* const last = passes.data() + passes.size();
    const auto a = std::from_chars(passes.data(), last, first);
    const bool has_colon = a.ec == std::errc() && a.ptr != last && *a.ptr == ':';
    const auto b = has_colon ? std::from_chars(a.ptr + 1, last, end) : a;
    if (!has_colon || b.ec != std::errc() || b.ptr != last || end <= first)
        throw UsageError(fmt::format(
            "--passes must have the form A:B, for the passes A to B-1, but is \"{}\"", passes));
    return {first, end - first};
}

std::optional<CheckpointFile> RenderCommand::earlier_checkpoint() const {
    if (resume.empty()) return {};
    if (resume != kAuto) return CheckpointFile(resume);
    std::error_code error;
    const bool is_there = std::filesystem::exists(checkpoint, error);
    // One that cannot be read now is not replaced by a rendering that starts anew.
    if (error)
        throw std::runtime_error(
            fmt::format("cannot read \"{}\": {}", checkpoint, error.message()));
    return is_there ? std::optional<CheckpointFile>(checkpoint) : std::nullopt;
}

bool RenderCommand::replaces_another_checkpoint() const {
    std::error_code error;
    const std::string& file = checkpoint_file();
    const bool is_resumed = resume == kAuto || std::filesystem::equivalent(resume, file, error);
    return !is_resumed && replaces_checkpoint(file);
}

void RenderCommand::warn_of_replaced_checkpoint(const Conditions& conditions) const {
    const std::string& file = checkpoint_file();
    std::string what;
    const std::string damage = failure_of([&] {
        const std::string obstacle = CheckpointFile(file).obstacle(conditions);
        what = obstacle.empty() ? "with --resume auto, the rendering would go on from it"
                                : fmt::format("it could not be resumed: {}", obstacle);
    });
    print_warnings({fmt::format("{} is replaced; {}", file, damage.empty() ? what : damage)});
}

RenderSettings RenderCommand::settings_for(const Scene& s) const {
    RenderRequest r = request;
    const auto [first_pass, count] = pass_range();
    r.first_pass = first_pass;
    if (count > 0) r.spp = count;
    set_default_limit(r, s);
    if (!techniques.empty()) r.technique_depth = technique_depth;
    return settings_of(r, s);
}

void RenderCommand::choose_method(Job& job, const std::string& earlier) const {
    if (earlier.empty())
        job.settings = with_chosen_method(job.scene, job.settings);
    else
        job.settings = with_chosen_method(job.settings, MethodChoice::from_json(earlier));
    if (job.settings.choice && !quiet) message("{}\n", job.settings.choice->message());
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
    std::string failure = failure_of(task);
    if (failure.empty()) return true;
    failures.push_back(std::move(failure));
    return false;
}

void RenderCommand::write_image_somewhere(const ImageRows& image,
                                          std::vector<std::string>& failures) const {
    namespace fs = std::filesystem;
    if (attempt(failures, [&] { display.write(output, image, request.threads); })) return;
    const std::string name =
        fmt::format("etendue-{}{}", ::getpid(), fs::path(output).extension().string());
    std::error_code error;
    for (const fs::path& folder : {fs::current_path(error), fs::temp_directory_path(error)}) {
        const fs::path file = folder / name;
        std::vector<std::string> ignored;
        if (folder.empty() || fs::exists(file, error)) continue;
        if (!attempt(ignored, [&] { display.write(file.string(), image, request.threads); }))
            continue;
        failures.back() += fmt::format("; the image is in {}", file.string());
        return;
    }
}

std::vector<std::string> RenderCommand::write_outputs(const Renderer& renderer,
                                                      const std::vector<AovImage>& layers,
                                                      const nlohmann::json& report) const {
    std::vector<std::string> failures;
    const bool has_variance = std::find(aovs.begin(), aovs.end(), "variance") != aovs.end();
    const bool has_layers = has_variance || !layers.empty();
    const auto write_layers = [&] {
        display.write(output, image_rows(renderer.film(), layers, has_variance, report),
                      request.threads);
    };
    // The image alone needs the least memory and space. The one with layers replaces it, except in devices and pipes.
    if (is_in_place() && has_layers)
        attempt(failures, write_layers);
    else if (attempt(failures,
                     [&] {
                         write_image_somewhere(image_rows(renderer.film(), {}, false, report),
                                               failures);
                     }) &&
             failures.empty() && has_layers && !attempt(failures, write_layers))
        failures.back() += fmt::format("; {} has the image without further layers", output);
    if (renderer.techniques())
        attempt(failures, [&] {
            write_techniques(*renderer.techniques(), renderer.film().geometry(), techniques);
        });
    if (!stats.empty()) attempt(failures, [&] { write_file(stats, json_text(report)); });
    return failures;
}

void RenderCommand::write_denoised(const Job& job, const nlohmann::json& report) const {
    const auto begin = std::chrono::steady_clock::now();
    display.write(
        denoised_file(),
        job.denoiser->denoise(to_image(image_rows(job.renderer->film(), job.guides, false, report)),
                              job.settings.threads),
        request.threads);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    if (!quiet)
        message("{}: denoised in {} by {}\n", denoised_file(), format_seconds(taken.count()),
                job.denoiser->name());
}

/// A failure of which all processes know. The first one reports it.
struct CommonFailure : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Calls `task` in all processes. If it fails in one of them, it fails in all.
template <class Task>
auto together(const Ranks& ranks, const Task& task) {
    if (ranks.count() == 1) return task();
    decltype(task()) result{};
    std::vector<std::string> failures;
    attempt(failures, [&] { result = task(); });
    failures = ranks.gather(failures.empty() ? "" : failures.front());
    for (size_t r = 0; r < failures.size(); ++r)
        if (!failures[r].empty())
            throw CommonFailure(r == 0 ? failures[r]
                                       : fmt::format("process {}: {}", r, failures[r]));
    return result;
}

/// Throws unless all processes make the same passes with the same bits.
void check_conditions(Conditions conditions, uint64_t passes, const Ranks& ranks) {
    if (ranks.count() == 1) return;
    // A checkpoint that not all of them have found.
    conditions.emplace_back("passes so far", fmt::format("{}", passes));
    const std::vector<std::string> all = ranks.gather(nlohmann::json(conditions).dump());
    for (size_t r = 1; r < all.size(); ++r) {
        if (all[r] == all[0]) continue;
        std::vector<std::string> differences;
        const auto first = nlohmann::json::parse(all[0]), other = nlohmann::json::parse(all[r]);
        for (size_t i = 0; i < std::min(first.size(), other.size()); ++i)
            if (first[i] != other[i])
                differences.push_back(fmt::format("{}: {} and {}", first[i][0].get<std::string>(),
                                                  first[i][1].dump(), other[i][1].dump()));
        throw CommonFailure(fmt::format("processes 0 and {} cannot render one image together; {}",
                                        r, fmt::join(differences, "; ")));
    }
}

/// While one exists, nothing is printed: what several processes say is said by the first one.
class Silence {
public:
    Silence() : errors_(::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0)) {
        const Descriptor nothing(::open("/dev/null", O_WRONLY | O_CLOEXEC));
        if (nothing.is_open()) ::dup2(nothing.get(), STDERR_FILENO);
    }
    ~Silence() {
        if (errors_.is_open()) ::dup2(errors_.get(), STDERR_FILENO);
    }
    Silence(const Silence&) = delete;
    Silence& operator=(const Silence&) = delete;

private:
    Descriptor errors_;
};

std::unique_ptr<RenderCommand::Job> RenderCommand::make_job(const Ranks& ranks) const {
    check_options();
    const bool is_first = ranks.index() == 0;
    if (ranks.count() > 1 && !preview.empty())
        throw std::runtime_error("--preview shows the image of one process, not of several");
    SceneOptions loading = scene;
    loading.threads = request.threads;
    const bool replaces_another = replaces_another_checkpoint();
    std::optional<CheckpointFile> earlier = earlier_checkpoint();
    const bool needs_conditions = !checkpoint_file().empty() || ranks.count() > 1;
    uint64_t fingerprint = 0;
    // Without the library, all else would be in vain.
    std::unique_ptr<Denoiser> denoiser;
    if (denoise && is_first) denoiser = std::make_unique<Denoiser>();
    std::unique_ptr<Job> job(new Job{[&] {
        const SceneDescription description = read_scene(loading);
        if (needs_conditions) fingerprint = scene_fingerprint(description);
        return build_scene(description, loading);
    }()});
    const Scene& s = job->scene;
    print_warnings(warnings_of(s, request.integrator));
    job->settings = settings_for(s);
    job->settings.ranks = &ranks;
    choose_method(*job, earlier ? earlier->header().choice : "");
    if (job->settings.technique_depth > 0 && !quiet)
        message("technique images of paths up to {} edges: {:.0f} MiB\n", technique_depth,
                double(TechniqueImages::memory_bytes(s.film().pixel_count(), technique_depth)) /
                    (1 << 20));
    job->renderer = make_renderer(s, job->settings);
    Renderer& renderer = *job->renderer;
    print_warnings(memory_warnings(renderer));
    if (is_first) check_outputs();
    if (needs_conditions)
        job->conditions = conditions_of(renderer, s, {fingerprint, scene.lenient, scene.watertight},
                                        job->settings);
    if (replaces_another) warn_of_replaced_checkpoint(job->conditions);
    if (earlier) {
        earlier->resume(renderer, job->conditions, job->log);
        if (!quiet)
            message("{}: resumed after {} passes, {}\n", earlier->name(), renderer.film().passes(),
                    format_seconds(renderer.seconds()));
    }
    // Before the passes, so that nothing that can fail stands between them and their image.
    const auto layers = [&](const std::vector<std::string>& names) {
        return render_aovs(s, names, kAovSamples, job->settings.seed, job->settings.threads);
    };
    if (is_first) job->layers = layers(aovs);
    if (denoiser) job->guides = layers({"denoise_albedo", "denoise_normal"});
    job->denoiser = std::move(denoiser);
    return job;
}

void RenderCommand::run() const {
    std::unique_ptr<const Ranks> ranks = join_ranks();
    if (const std::string warning = warning_of_strangers(*ranks); !warning.empty())
        print_warnings({warning});
    if (scene.memory.empty()) share_available_memory(ranks->on_this_machine());
    std::optional<Silence> silence;
    if (ranks->index() > 0) silence.emplace();
    try {
        const std::unique_ptr<Job> job = together(*ranks, [&] { return make_job(*ranks); });
        check_conditions(job->conditions, job->renderer->film().passes(), *ranks);
        render(*job, *ranks);
    } catch (const CommonFailure&) {
        // Before any process ends, since mpirun then ends the others.
        print_failure();
        ranks.reset();
        end_at_once(EXIT_FAILURE);
    }
}

void RenderCommand::render(Job& job, const Ranks& ranks) const {
    const Scene& s = job.scene;
    Renderer& renderer = *job.renderer;
    PassLog& log = job.log;
    const bool is_first = ranks.index() == 0;
    const Interrupts interrupts = catch_interrupts(grace);
    if (ranks.count() > 1) catch_signal_of_mpirun();
    std::unique_ptr<Preview> viewer;
    if (!preview.empty())
        viewer =
            std::make_unique<Preview>(preview, output, s.film().crop_width, s.film().crop_height);

    const std::string& saved = checkpoint_file();
    const auto written_state = [&] {
        return written_checkpoint(saved, renderer, s, job.conditions, job.settings, log);
    };
    LaterCommit last_checkpoint;
    const bool has_variance = std::find(aovs.begin(), aovs.end(), "variance") != aovs.end();
    // An interval that is given for checkpoints is kept, if they take less time than it.
    Timer checkpoints(
        WritingPace::of_checkpoints(saved.empty() ? 0 : checkpoint_every.value_or(kCheckpointEvery),
                                    checkpoint_every ? 1 : WritingPace::kMostOfTime));
    Timer images(WritingPace{is_in_place() ? 0 : write_every});
    // What fails now may succeed later, and is no reason to end.
    const auto warn_of_failures = [](const auto& task) {
        std::vector<std::string> problems;
        attempt(problems, task);
        print_warnings(problems);
    };
    // All processes gather what the first one writes.
    const auto write_if_due = [&](Timer& timer, bool may_be, const auto& task) {
        if (!ranks.of_first(may_be && timer.is_due())) return;
        timer.call([&] {
            renderer.gather();
            if (is_first) warn_of_failures(task);
        });
    };
    std::string stopped_by, failure;
    try {
        ProgressLine line(quiet || !is_first);
        stopped_by = to_string(renderer.run(
            [&](const Progress& p) {
                line.show(p);
                log.add(p.seconds, renderer.stats().pairs);
                if (viewer && !viewer->update(renderer.film(), p.seconds)) viewer.reset();
                const bool goes_on = !interrupts.stop && p.fraction.value_or(0) < 1;
                if (!p.ends_round) return;
                write_if_due(checkpoints, goes_on, [&] {
                    warn_of_failures([&] { last_checkpoint.finish(); });
                    last_checkpoint.begin(written_state());
                });
                write_if_due(images, goes_on, [&] {
                    display.write(output,
                                  image_rows(renderer.film(), job.layers, has_variance,
                                             to_json(renderer, s, job.settings, "unfinished", log)),
                                  request.threads);
                });
            },
            interrupts.stop, interrupts.drop));
    } catch (...) {
        // The passes before it are complete and can be written.
        if (renderer.film().passes() == 0 || !renderer.ended_together()) throw;
        stopped_by = "failure";
        failure = caught();
    }
    end_grace();
    // The passes may have taken all of it, and what there is needs some more to be written.
    const UnlimitedMemory unlimited;
    const uint64_t passes = renderer.film().passes();
    if (passes == 0) throw std::runtime_error("interrupted in the first pass: nothing was written");
    renderer.gather();
    if (!is_first) return;

    const ErrorEstimate e = renderer.error();
    nlohmann::json report = to_json(renderer, s, job.settings, stopped_by, log, &e);
    if (!failure.empty()) report["failure"] = failure;
    // How long the passes have waited.
    if (images.calls() > 0)
        report["images"] = {{"written", images.calls()}, {"seconds", images.seconds()}};
    std::vector<std::string> failures;
    if (!saved.empty()) {
        warn_of_failures([&] { last_checkpoint.finish(); });
        report["checkpoints"] = {{"written", last_checkpoint.written()},
                                 {"seconds", checkpoints.seconds()}};
        attempt(failures, [&] { written_state()->commit(); });
    }
    for (std::string& f : write_outputs(renderer, job.layers, report))
        failures.push_back(std::move(f));
    if (job.denoiser) attempt(failures, [&] { write_denoised(job, report); });

    print_warnings(warnings(renderer.stats()));
    if (!failure.empty())
        failures.insert(failures.begin(),
                        fmt::format("{}: {}; {} contains the {} before it",
                                    renderer.place_of_failure(), failure, output,
                                    passes == 1 ? "pass" : fmt::format("{} passes", passes)));
    if (!failures.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(failures, "; ")));
    if (quiet) return;
    message("{}: {} spp in {}, {:.3f} Msamples/s, {:.2f} Mrays/s{}\n", output, passes,
            format_seconds(renderer.seconds()), report["samples_per_second"].get<double>() * 1e-6,
            report["rays_per_second"].get<double>() * 1e-6, format_error(e));
}

}  // namespace

void add_render_command(CLI::App& app) {
    auto command = std::make_shared<RenderCommand>();
    CLI::App& c = *app.add_subcommand("render", "Render a scene to an image");
    c.add_option("-o,--output", command->output, "Image to write: .exr, .pfm, .hdr or .png")
        ->capture_default_str();
    c.add_option("-i,--integrator", command->request.integrator,
                 "Integrator with parameters: bdpt or bdpt:max_depth=12,rr_depth=5 (default: the "
                 "scene's, or auto)");
    c.add_option("--spp", command->request.spp, "Samples per pixel")->check(must_be_above_0);
    c.add_option("--time", command->request.seconds,
                 "Seconds to render; may be exceeded by half a pass")
        ->check(must_be_above_0);
    c.add_option("--error", command->request.error,
                 "Stop at this estimated relative RMS error of the image, e.g. 0.01")
        ->check(must_be_above_0);
    c.add_option("--passes", command->passes,
                 "Render the passes A to B-1 of the seed, A:B, for etendue merge");
    c.add_option(
        "--checkpoint", command->checkpoint,
        "File in which the state of the rendering is saved, to go on from it (--resume) or "
        "to merge it with others (etendue merge)");
    c.add_option("--checkpoint-every", command->checkpoint_every,
                 "Seconds between two checkpoints; 0: only at the end. The default is longer if "
                 "checkpoints would take more than a hundredth of the time, but a quarter of an "
                 "hour at most")
        ->default_str(fmt::format("{}", RenderCommand::kCheckpointEvery))
        ->check(must_be_within(0, 1e9));
    c.add_option(
        "--resume", command->resume,
        "Go on from this checkpoint, and save further ones in the same file if there is no "
        "--checkpoint; auto: from the one of --checkpoint, if that file exists");
    c.add_option("--write-every", command->write_every,
                 "Seconds after which the image so far is written; 0: only at the end")
        ->capture_default_str()
        ->check(must_be_within(0, 1e9));
    c.add_option("--grace", command->grace,
                 "Seconds that the current pass may continue after Ctrl-C, SIGTERM or SIGHUP")
        ->capture_default_str()
        ->check(CLI::Range(0, 86400));
    c.add_option("--seed", command->request.seed, "Seed of all random numbers")
        ->capture_default_str()
        ->check(must_be_unsigned);
    FilterMode& filter_mode = command->request.filter_mode;
    const CLI::Option* given_mode =
        c.add_option_function<std::string>(
             "--filter-mode",
             [&filter_mode](const std::string& name) {
                 filter_mode = filter_mode_named(name, "--filter-mode");
             },
             "spread: an eye path contributes to all pixels that the filter reaches; sample: to "
             "its own pixel, with a film point drawn from the filter")
            ->default_str(to_string(filter_mode));
    add_sampler_option(c, command->request.sampler,
                       "; with sobol the error estimate is an upper bound");
    c.add_option("--threads", command->request.threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_option("--aov", command->aovs,
                 "Layers to add: albedo, normal, depth, position, uv, denoise_albedo, "
                 "denoise_normal, variance")
        ->delimiter(',');
    c.add_flag("--denoise", command->denoise,
               "Write a denoised image beside the other one, as out.denoised.exr; with it, the "
               "filter mode is sample unless it is given");
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
    command->display.add_to(c);
    command->scene.add_to(c);
    set_group(
        c, "Long renderings",
        {"--checkpoint", "--checkpoint-every", "--resume", "--passes", "--write-every", "--grace"});
    set_group(c, kForExperts,
              {"--sampler", "--filter-mode", "--techniques", "--techniques-max-depth", "--preview",
               "--stats"});
    c.callback([command, given_mode] {
        if (command->denoise && given_mode->count() == 0)
            command->request.filter_mode = FilterMode::Sample;
        command->run();
    });
}

}  // namespace etendue
