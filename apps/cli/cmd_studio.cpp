#include <sys/stat.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <future>
#include <stdexcept>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "image/image_io.h"
#include "interrupt.h"
#include "scene_options.h"
#include "session/session.h"
#include "studio/api.h"
#include "studio/guard.h"
#include "studio/server.h"

namespace etendue {
namespace {

struct StudioCommand {
    SceneOptions scene;
    std::string integrator, sampler, output = ".", listen = "127.0.0.1", reference;
    int port = 0, threads = 0;
    unsigned grace = 20;
    bool idle = false;

    void run() const;

private:
    void start_first_run(Session& session) const;
    void save_all(Session& session) const;
};

/// A name in the folder that no file has yet.
std::string free_name(const std::string& folder, const std::string& stem) {
    for (int i = 1;; ++i) {
        const std::string name = fmt::format("{}/{}-{}.exr", folder, stem, i);
        if (!std::filesystem::exists(name)) return name;
    }
}

void StudioCommand::start_first_run(Session& session) const {
    RunRequest request;
    request.integrator = integrator;
    request.sampler = parse_sampler(sampler);
    try {
        session.start(request);
    } catch (const std::exception& e) {
        fmt::print(stderr, "warning: nothing is rendered yet: {}\n", e.what());
    }
}

void StudioCommand::save_all(Session& session) const {
    session.settle();
    const std::string stem = std::filesystem::path(scene.file).stem().string();
    for (const RunStatus& s : session.runs()) {
        if (s.passes == 0) continue;
        const std::string file = free_name(output, stem);
        std::promise<std::string> saved;
        session.save(s.id, file, [&](const std::string& error) { saved.set_value(error); });
        if (const std::string error = saved.get_future().get(); !error.empty())
            throw std::runtime_error(fmt::format("{}: {}", file, error));
        fmt::print(stderr, "{}: run {}, {}, {} spp\n", file, s.id, s.integrator, s.passes);
    }
}

void StudioCommand::run() const {
    std::error_code error;
    std::filesystem::create_directories(output, error);
    if (!std::filesystem::is_directory(output))
        throw std::runtime_error(fmt::format("--output: {} is not a folder", output));
    if (!std::filesystem::exists(scene.file))
        throw std::runtime_error(fmt::format("{}: no such file", scene.file));
    parse_sampler(sampler);
    if (!integrator.empty()) make_integrator(IntegratorSpec::parse(integrator));
    ApiOptions options;
    options.token = make_token();
    options.scene_file = scene.file;
    options.output_folder = output;
    if (!reference.empty()) options.reference = read_rgb(reference);

    const Interrupts interrupts = catch_interrupts(grace);
    // Declared so that what calls others is destroyed before these.
    Server server(listen, port);
    SceneOptions loading = scene;
    loading.threads = threads;
    Session session([loading] { return load_scene(loading); }, threads);
    if (listen != "127.0.0.1" && listen != "::1")
        fmt::print(stderr, "warning: {} can be reached from other machines, without encryption\n",
                   listen);
    Api api(session, options);
    server.start(api);
    fmt::print("{}/#token={}\n", server.url(), options.token);
    std::fflush(stdout);

    bool is_started = idle;
    std::string reported;
    while (!interrupts.stop) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        if (!is_started && session.scene()) {
            for (const std::string& w : session.scene()->warnings())
                fmt::print(stderr, "warning: {}\n", w);
            start_first_run(session);
            is_started = true;
        }
        if (const std::string e = session.load_error(); e != reported) {
            if (!e.empty()) fmt::print(stderr, "{}\n", e);
            reported = e;
        }
    }
    session.stop_all(false);
    std::promise<void> finished;
    std::thread dropper([&, done = finished.get_future()] {
        while (done.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready)
            if (interrupts.drop) session.stop_all(true);
    });
    try {
        save_all(session);
    } catch (...) {
        finished.set_value();
        dropper.join();
        throw;
    }
    finished.set_value();
    dropper.join();
    server.stop();
}

}  // namespace

void add_studio_command(CLI::App& app) {
    auto command = std::make_shared<StudioCommand>();
    CLI::App& c = *app.add_subcommand(
        "studio", "Show a progressive rendering in a browser, compare methods, edit light paths");
    command->scene.add_to(c);
    c.add_option("-i,--integrator", command->integrator,
                 "Integrator of the first run, with parameters (default: the scene's)");
    add_sampler_option(c, command->sampler);
    c.add_flag("--idle", command->idle, "Render nothing until the page asks for it");
    c.add_option("-o,--output", command->output,
                 "Folder for saved images and light paths; on Ctrl-C the images of all runs are "
                 "written there, without replacing files")
        ->capture_default_str();
    c.add_option("--reference", command->reference,
                 "Reference image of the same size: .exr, .pfm or .hdr");
    c.add_option("--threads", command->threads, "Number of threads; 0: one per core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    c.add_option("--port", command->port, "Port of the page; 0: any free port")
        ->capture_default_str()
        ->check(CLI::Range(0, 65535));
    c.add_option("--listen", command->listen,
                 "Address to listen at; an address other than 127.0.0.1 can be reached from other "
                 "machines, without encryption (consider ssh -L instead)")
        ->capture_default_str();
    c.add_option("--grace", command->grace,
                 "Seconds that the current pass may continue after Ctrl-C or SIGTERM")
        ->capture_default_str()
        ->check(CLI::Range(0, 86400));
    c.callback([command] { command->run(); });
}

}  // namespace etendue
