#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <future>
#include <stdexcept>
#include <thread>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "description/fingerprint.h"
#include "image/denoiser.h"
#include "image/image_io.h"
#include "interrupt.h"
#include "messages.h"
#include "render/scene_integrator.h"
#include "scene_options.h"
#include "session/session.h"
#include "session/shared_slot.h"
#include "studio/api.h"
#include "studio/guard.h"
#include "studio/server.h"
#include "system/memory_limit.h"
#include "system/output_file.h"

namespace etendue {
namespace {

struct StudioCommand {
    SceneOptions scene;
    RunRequest first_run;
    std::string output = ".", runs, listen = "127.0.0.1", reference;
    std::vector<std::string> hosts;
    int port = 0, threads = 0;
    unsigned grace = 20;
    bool idle = false;

    void run() const;

private:
    void check_files() const;
    ApiOptions api_options() const;
    LoadedScene load(const SceneView& view) const;
    void print_urls(const Server& server, const std::string& token) const;
    void start_first_run(Session& session) const;
    void watch(Session& session, const Api& api, const std::atomic<bool>& stop) const;
    void save_all(Session& session) const;
    void tell_of_kept_runs(Session& session) const;
    void finish(Session& session, const std::atomic<bool>& drop) const;
};

/// A name in the folder that no file has yet.
std::string free_name(const std::string& folder, const std::string& stem) {
    for (int i = 1;; ++i) {
        const std::string name = fmt::format("{}/{}-{}.exr", folder, stem, i);
        std::error_code ignored;  // Where the folder cannot be read, saving will tell.
        if (!std::filesystem::exists(std::filesystem::symlink_status(name, ignored))) return name;
    }
}

void StudioCommand::start_first_run(Session& session) const {
    try {
        session.start(first_run);
    } catch (const std::exception& e) {
        message("warning: nothing is rendered yet: {}\n", e.what());
    }
}

Saved save_and_wait(Session& session, int run, const std::string& file, bool replaces = false) {
    auto answer = std::make_shared<std::promise<Saved>>();
    std::future<Saved> saved = answer->get_future();
    try {
        session.save(run, file, replaces, [answer](const Saved& s) { answer->set_value(s); });
        answer.reset();  // Without memory there may be no answer; its last owner tells so.
        return saved.get();
    } catch (const std::exception&) {
        return {"not enough memory", 0};
    }
}

/// Saves the image of every run, those first that need not wait for the pass in flight. What cannot be saved in the output
/// folder is saved in that for temporary files. Throws only after all were tried.
void StudioCommand::save_all(Session& session) const {
    const std::string stem = std::filesystem::path(scene.file).stem().string();
    std::error_code ignored;
    const std::string other = std::filesystem::temp_directory_path(ignored).string();
    std::string errors;
    struct File {
        RunStatus run;
        std::string name;
        uint64_t passes;
    };
    std::vector<File> files;
    const auto tell = [](const RunStatus& s, const std::string& file, const Saved& saved) {
        message("{}: run {}, {}, {} spp\n", file, s.id, s.request.integrator, saved.passes);
    };
    const auto save_one = [&](const RunStatus& s) {
        for (const std::string& folder : {output, other}) {
            if (folder.empty()) continue;  // There is none for temporary files.
            const std::string file = free_name(folder, stem);
            const Saved saved = save_and_wait(session, s.id, file);
            if (saved.error.empty()) {
                tell(s, file, saved);
                files.push_back({s, file, saved.passes});
                return;
            }
            // A run in its first pass may have been discarded.
            if (session.status(s.id).passes == 0) return;
            message("{}: {}\n", file, saved.error);
            if (folder == output)
                errors +=
                    fmt::format("{}run {}: {}", errors.empty() ? "" : "; ", s.id, saved.error);
        }
    };
    std::vector<RunStatus> runs = session.runs();
    std::stable_partition(runs.begin(), runs.end(),
                          [](const RunStatus& s) { return s.state != RunState::Stopping; });
    for (const RunStatus& s : runs) try {
            const bool is_only_opened = s.opened_passes > 0 && s.passes == s.opened_passes;
            if (!is_only_opened && (s.passes > 0 || s.state == RunState::Stopping)) save_one(s);
        } catch (const std::exception& e) {
            // Such as that the page has removed the run.
            message("run {}: {}\n", s.id, e.what());
        }
    // A pass that was in flight may be finished since.
    if (std::ranges::any_of(files, [](const File& f) { return f.run.state == RunState::Stopping; }))
        session.settle();
    for (const File& f : files) try {
            if (session.status(f.run.id).passes <= f.passes) continue;
            const Saved saved = save_and_wait(session, f.run.id, f.name, true);
            if (saved.error.empty()) tell(f.run, f.name, saved);
        } catch (const std::exception& e) {
            message("run {}: {}\n", f.run.id, e.what());
        }
    if (!errors.empty()) throw std::runtime_error(errors);
}

/// Waits until the runs are kept. Throws if one is not.
void StudioCommand::tell_of_kept_runs(Session& session) const {
    if (runs.empty()) return;
    session.settle();
    std::vector<std::string> errors;
    for (const RunStatus& s : session.runs()) {
        if (!s.file_problem.empty())
            errors.push_back(fmt::format("run {} is not kept: {}", s.id, s.file_problem));
        else if (!s.file.empty() && s.passes > s.opened_passes)
            message("{}/{}: run {} is kept, {}, {} spp\n", runs, s.file, s.id, s.request.integrator,
                    s.file_passes);
    }
    if (!errors.empty()) throw std::runtime_error(fmt::format("{}", fmt::join(errors, "; ")));
}

/// Saves all images, and waits for the files of runs. `drop`, of a second signal or at the end of the time of grace,
/// discards the pass in flight.
void StudioCommand::finish(Session& session, const std::atomic<bool>& drop) const {
    // The runs may have taken all of it, and what there is needs some more to be written.
    const UnlimitedMemory unlimited;
    std::atomic<bool> is_saved{false};
    std::thread dropper;
    try {
        dropper = std::thread([&] {
            while (!is_saved) {
                std::this_thread::sleep_for(std::chrono::milliseconds(50));
                if (drop) session.stop_all(true);
            }
        });
    } catch (const std::exception&) {
        // Nobody would heed another signal.
        session.stop_all(true);
    }
    std::exception_ptr failure;
    try {
        save_all(session);
    } catch (...) {
        failure = std::current_exception();
    }
    try {
        tell_of_kept_runs(session);
    } catch (const std::exception& e) {
        // Of two failures, the program reports one at its end.
        if (failure) message("{}\n", e.what());
        if (!failure) failure = std::current_exception();
    }
    is_saved = true;
    if (dropper.joinable()) dropper.join();
    if (failure) std::rethrow_exception(failure);
}

ApiOptions StudioCommand::api_options() const {
    ApiOptions options;
    options.token = make_token();
    options.scene_file = scene.file;
    options.output_folder = output;
    options.threads = threads;
    if (!reference.empty()) {
        refuse_denoised_reference(reference, read_image(reference));
        options.reference = read_rgb(reference);
    }
    for (const std::string& host : hosts) {
        if (!is_host_name(host))
            throw std::runtime_error(fmt::format(
                "--host: \"{}\" is no host name: only letters, digits, '-' and '.' are allowed",
                host));
        options.hosts.push_back(lower_case(host));
    }
    // Where it is a name, the page is asked for by it. Addresses are compared with the one at which a request arrives.
    const bool is_address = listen.find_first_not_of("0123456789.") == std::string::npos;
    if (is_host_name(listen) && !is_address) options.hosts.push_back(lower_case(listen));
    return options;
}

void StudioCommand::print_urls(const Server& server, const std::string& token) const {
    std::vector<std::string> urls;
    for (const std::string& host : hosts) urls.push_back(server.url(host));
    for (std::string& url : server.urls()) urls.push_back(std::move(url));
    for (const std::string& url : urls) fmt::print("{}/#token={}\n", url, token);
    if (std::fflush(stdout) != 0 || std::ferror(stdout))
        throw std::runtime_error("the address of the page cannot be printed");
    if (!server.is_local())
        message("warning: {} can be reached from other machines, without encryption\n", listen);
}

/// Until `stop`: starts the first run, and tells what becomes of the scene.
void StudioCommand::watch(Session& session, const Api& api, const std::atomic<bool>& stop) const {
    bool is_started = idle;
    uint64_t version = 0;
    std::string reported;
    while (!stop) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        if (session.scene_version() != version) {
            version = session.scene_version();
            for (const std::string& w : warnings_of(*session.scene(), first_run.integrator))
                message("warning: {}\n", w);
            if (const std::string problem = api.reference_problem(); !problem.empty())
                message("warning: {}\n", problem);
            if (!is_started) start_first_run(session);
            is_started = true;
        }
        if (const std::string e = session.load_error(); e != reported) {
            if (!e.empty()) message("{}\n", e);
            reported = e;
        }
    }
}

/// By how much a transform stretches each axis; the first one is negative where it mirrors the image.
Vec3 scale_of(const Transform& t) {
    const float mirror = t.determinant3() < 0 ? -1.0f : 1.0f;
    return {mirror * length(t.vector({1, 0, 0})), length(t.vector({0, 1, 0})),
            length(t.vector({0, 0, 1}))};
}

/// Puts all sensors, one of which is used, where the camera is. A sensor that mirrors the image still does, and an
/// orthographic one shows as much as before.
void place_sensors(SceneDescription& description, const SceneView::Camera& camera) {
    const auto to_world = Transform::look_at(camera.eye, camera.target, camera.up);
    for (SceneObject& o : description.objects) {
        if (o.category != "sensor" || !to_world) continue;
        const Param* old = o.find("to_world");
        const Transform* before = old ? old->as<Transform>() : nullptr;
        Param placed{
            "to_world",
            SharedTransform(before ? *to_world * Transform::scale(scale_of(*before)) : *to_world),
            o.where};
        std::erase_if(o.params, [](const Param& p) { return p.name == "to_world"; });
        o.params.push_back(std::move(placed));
    }
}

LoadedScene StudioCommand::load(const SceneView& view) const {
    SceneOptions loading = scene;
    loading.threads = threads;
    if (!view.sensor.empty()) loading.sensor = view.sensor;
    if (view.crop) loading.crop = fmt::format("{}", fmt::join(*view.crop, ","));
    SceneDescription description = read_scene(loading);
    if (view.camera) place_sensors(description, *view.camera);
    const SceneSource source{.fingerprint = runs.empty() ? 0 : scene_fingerprint(description),
                             .lenient = loading.lenient,
                             .watertight = loading.watertight};
    return {build_scene(description, loading), source};
}

/// Creates missing folders.
void StudioCommand::check_files() const {
    for (const auto& [option, folder] : {std::pair("--output", output), {"--runs", runs}}) {
        if (folder.empty()) continue;
        std::error_code error;
        std::filesystem::create_directories(folder, error);
        if (!std::filesystem::is_directory(folder))
            throw std::runtime_error(fmt::format("{}: {} is not a folder", option, folder));
    }
    if (!runs.empty()) OutputFile::check(free_name(runs, "run"));
    if (!std::filesystem::exists(scene.file))
        throw std::runtime_error(fmt::format("{}: no such file", scene.file));
}

void StudioCommand::run() const {
    check_files();
    if (const std::string& i = first_run.integrator; !i.empty())
        make_integrator(IntegratorSpec::parse(i));
    ApiOptions options = api_options();
    SharedSlot<const SceneView> view(std::make_shared<const SceneView>());
    options.set_view = [&](const SceneView& v) {
        view.store(std::make_shared<const SceneView>(v));
    };

    const Interrupts interrupts = catch_interrupts(grace);
    // Declared so that what calls others is destroyed before these.
    Server server(listen, port);
    Session session([this, &view] { return load(*view.load()); }, threads, {.folder = runs});
    Api api(session, options);
    const Server::Serving serving = server.start(api);
    try {
        print_urls(server, options.token);
        watch(session, api, interrupts.stop);
        session.close(false);
        finish(session, interrupts.drop);
    } catch (const std::exception&) {
        session.close(true);
        if (!session.is_loading()) throw;
        print_failure();
        end_at_once(1);
    }
    // The session would wait until the scene is loaded, which nobody needs any longer.
    if (session.is_loading()) end_at_once(session.scene() ? 0 : 130);
}

}  // namespace

void add_studio_command(CLI::App& app) {
    auto command = std::make_shared<StudioCommand>();
    CLI::App& c = *app.add_subcommand(
        "studio", "Show a progressive rendering in a browser, compare methods, edit light paths");
    command->scene.add_to(c);
    c.add_option("-i,--integrator", command->first_run.integrator,
                 "Integrator of the first run, with parameters (default: the scene's, or auto)");
    add_sampler_option(c, command->first_run.sampler);
    c.add_flag("--idle", command->idle, "Render nothing until the page asks for it");
    c.add_option("-o,--output", command->output,
                 "Folder for saved images and light paths; on Ctrl-C the images of all runs are "
                 "written there, without replacing files")
        ->capture_default_str();
    c.add_option(
        "--runs", command->runs,
        "Folder in which the runs are kept, and from which those of the scene can be opened "
        "again (default: none)");
    c.add_option("--reference", command->reference,
                 "Reference image of the same size: .exr, .pfm or .hdr");
    c.add_option("--threads", command->threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_option("--port", command->port, "Port of the page; 0: any free port")
        ->capture_default_str()
        ->check(CLI::Range(0, 65535));
    c.add_option("--listen", command->listen,
                 "Address or host name to listen at, 0.0.0.0 or :: for all; one other than "
                 "127.0.0.1 can be reached from other machines, without encryption (consider ssh "
                 "-L instead)")
        ->capture_default_str();
    c.add_option("--host", command->hosts,
                 "Host name by which the page may be opened, beside addresses and localhost; "
                 "repeatable")
        ->allow_extra_args(false);
    c.add_option("--grace", command->grace,
                 "Seconds that the current pass may continue after Ctrl-C or SIGTERM")
        ->capture_default_str()
        ->check(CLI::Range(0, 86400));
    c.callback([command] { command->run(); });
}

}  // namespace etendue
