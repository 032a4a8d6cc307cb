#include <stdexcept>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "mcmc/pick_paths.h"
#include "number_checks.h"
#include "output_checks.h"
#include "scene_options.h"
#include "system/output_file.h"
#include "usage_error.h"

namespace etendue {
namespace {

struct PathsCommand {
    SceneOptions scene;
    PickOptions pick;
    int count = 0;
    std::vector<int> pixel;
    std::string output, check;

    void run();
};

void check_paths(const Scene& scene, const std::string& file) {
    const std::vector<GivenPath> given = read_user_paths(file);
    if (given.empty()) throw std::runtime_error(file + ": has no paths");
    size_t usable = 0;
    for (size_t i = 0; i < given.size(); ++i) {
        const CheckedPath checked = check_user_path(scene, given[i]);
        usable += checked.path.has_value();
        if (!checked.path) fmt::print("{}\n", to_string(checked, given[i], i, file));
    }
    fmt::print("{}: {} of {} path{} can be used\n", file, usable, given.size(),
               given.size() == 1 ? "" : "s");
    if (usable < given.size()) throw std::runtime_error(file + ": some paths cannot be used");
}

void PathsCommand::run() {
    if (check.empty() == (count == 0))
        throw UsageError("paths: expected either --pick N or --check FILE");
    if (count > 0 && (pixel.empty() || output.empty()))
        throw UsageError("paths: --pick needs --pixel x,y and -o FILE");
    refuse_same_file("scene", scene.file, "paths", output);
    const Scene s = load_scene(scene);
    if (count == 0) return check_paths(s, check);
    OutputFile::check(output);
    pick.count = count;
    pick.x = pixel[0], pick.y = pixel[1];
    const std::vector<GivenPath> picked = pick_paths(s, pick);
    write_file(output, to_json(picked));
    fmt::print("{}: {} path{}\n", output, picked.size(), picked.size() == 1 ? "" : "s");
}

}  // namespace

void add_paths_command(CLI::App& app) {
    auto options = std::make_shared<PathsCommand>();
    CLI::App& c = *app.add_subcommand(
        "paths", "Pick or check light paths for the parameter user_paths of mlt and mps");
    options->scene.add_to(c);
    CLI::Option* pick =
        c.add_option("--pick", options->count,
                     "Save up to this many paths, drawn in proportion to their contributions")
            ->check(CLI::Range(1, 10000));
    c.add_option("--pixel", options->pixel, "Column and row of the pixel that the paths reach: x,y")
        ->delimiter(',')
        ->expected(2)
        ->needs(pick);
    c.add_option("--length", options->pick.length,
                 "Length of the full paths in edges, from the emitter to the lens")
        ->check(CLI::Range(2, 64))
        ->capture_default_str()
        ->needs(pick);
    c.add_option("--samples", options->pick.samples, "Number of paths to sample")
        ->check(CLI::Range(uint64_t(1), uint64_t(1) << 40))
        ->capture_default_str()
        ->needs(pick);
    c.add_option("--seed", options->pick.seed, "Seed of all random numbers")
        ->capture_default_str()
        ->check(must_be_unsigned)
        ->needs(pick);
    c.add_option("-o,--output", options->output, "JSON file to write")->needs(pick);
    c.add_option("--check", options->check,
                 "JSON file of paths to check; prints the reason for each path that cannot be used")
        ->excludes(pick);
    c.callback([options] { options->run(); });
}

}  // namespace etendue
