#include <algorithm>
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "display_options.h"
#include "figures.h"
#include "image/image_io.h"
#include "json_text.h"
#include "messages.h"
#include "output_checks.h"
#include "render/merging.h"
#include "render/warnings.h"
#include "system/output_file.h"
#include "technique_files.h"
#include "usage_error.h"

namespace etendue {
namespace {

struct MergeCommand {
    std::vector<std::string> files;
    std::string output = "out.exr", techniques, stats;
    DisplayOptions display;
    bool has_variance = false, quiet = false;

    void run() const {
        const bool is_image = std::filesystem::path(output).extension() != ".etd";
        if (is_image) check_image_extension(output);
        display.check();
        if (!is_image && has_variance)
            throw UsageError(
                fmt::format("--variance adds a layer to an image, but {} is none", output));
        if (has_variance && image_extension(output) != ".exr")
            throw UsageError(
                fmt::format("--variance: {} would have no layers; an .exr file has them", output));
        refuse_same_file("sum", output, "statistics", stats);
        for (const std::string& file : files) {
            refuse_same_file("sum", output, "checkpoint", file);
            refuse_same_file("statistics", stats, "checkpoint", file);
        }
        // A sum can replace an earlier one, but no other file: a rendering cannot go on from it.
        if (!is_image && replaces_checkpoint(output) && CheckpointFile(output).has_state())
            throw std::runtime_error(fmt::format(
                "{} is not replaced by a sum, since it is the checkpoint of a rendering", output));
        OutputFile::check(output);
        if (!stats.empty()) OutputFile::check(stats);
        std::vector<CheckpointFile> parts;
        for (const std::string& file : files) parts.emplace_back(file);
        Merging merging(std::move(parts));
        if (!techniques.empty() && merging.first().header().technique_depth == 0)
            throw std::runtime_error(
                fmt::format("--techniques: {} has no technique images; render with --techniques",
                            merging.first().name()));
        if (!techniques.empty()) check_technique_folder(techniques);
        print_warnings(merging.warnings());
        const RenderTotals totals = merging.totals();
        print_warnings(warnings(totals.stats));
        const nlohmann::json report = merging.report(totals);
        if (is_image)
            display.write(output, image_rows(*totals.film, {}, has_variance, report), 0);
        else
            merging.write(output, totals);
        if (!techniques.empty())
            write_techniques(*totals.techniques, totals.film->geometry(), techniques);
        if (!stats.empty()) write_file(stats, json_text(report));
        if (quiet) return;
        message("{}: {} spp of {} file{}{}\n", output, totals.film->passes(), files.size(),
                files.size() == 1 ? "" : "s", format_error(totals.film->error()));
    }
};

}  // namespace

void add_merge_command(CLI::App& app) {
    auto command = std::make_shared<MergeCommand>();
    CLI::App& c = *app.add_subcommand("merge", "Add up renderings of one scene by one method");
    c.add_option("FILES", command->files,
                 "Checkpoints (render --checkpoint) with other seeds or passes, or sums of them")
        ->required();
    c.add_option("-o,--output", command->output,
                 "Image to write (.exr, .pfm, .hdr or .png), or .etd: a file to merge again")
        ->capture_default_str();
    command->display.add_to(c);
    c.add_flag("--variance", command->has_variance, "Add the layer \"variance\" to the image");
    c.add_option("--techniques", command->techniques,
                 "Folder for the images of each technique (s,t), weighted and unweighted");
    c.add_option("--stats", command->stats, "Write statistics to this JSON file");
    c.add_flag("--quiet", command->quiet, "Print nothing but errors and warnings");
    c.callback([command] { command->run(); });
}

}  // namespace etendue
