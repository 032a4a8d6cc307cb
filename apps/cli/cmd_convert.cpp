#include <filesystem>
#include <map>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "messages.h"
#include "readers/mitsuba_writer.h"
#include "scene/mitsuba_manual.h"
#include "scene/plain_mitsuba.h"
#include "scene_options.h"
#include "system/output_file.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// Whether the manual of Mitsuba 3 has a parameter of a plug-in.
bool documents(const ManualEntry& entry, const std::string& param) {
    const std::string all = fmt::format(" {} {} ", entry.params, entry.params_3);
    // Meshes have lost what Mitsuba does not have when they are written.
    return all.find(" " + param + " ") != all.npos || std::string_view(entry.category) == "shape";
}

/// Says what etendue reads back but Mitsuba 3 does not know, once for each kind.
void warn_of_foreign_names(const SceneDescription& scene) {
    std::map<std::string, int> foreign;
    for (const SceneObject& o : scene.objects) {
        const ManualEntry* entry = find_manual_entry(o.category, o.type);
        const bool is_converted =
            (o.category == "shape" && o.type == "mesh") || o.category == "sampler";
        if (!is_converted && (!entry || !(entry->manuals & kMitsuba3)))
            ++foreign[fmt::format("{} \"{}\"", o.category, o.type)];
        else if (entry && !is_converted)
            for (const Param& p : o.params)
                if (!documents(*entry, p.name))
                    ++foreign[fmt::format("parameter \"{}\" of {} \"{}\"", p.name, o.category,
                                          o.type)];
    }
    for (const auto& [name, count] : foreign)
        message("warning: Mitsuba 3 has no {} ({} in the scene)\n", name, count);
}

void convert(const SceneOptions& options, const std::string& output, bool keep_plugins) {
    if (fs::path(output).extension() != ".xml")
        throw std::runtime_error(fmt::format("{}: the output must be an .xml file", output));
    if (fs::exists(output) && fs::equivalent(output, options.file))
        throw std::runtime_error(fmt::format("{}: the output is the scene itself", output));
    SceneDescription scene = read_scene(options);
    print_warnings(scene.warnings);
    if (keep_plugins)
        warn_of_foreign_names(scene);
    else
        print_warnings(make_plain_mitsuba(scene));
    const fs::path folder = fs::path(output).parent_path();
    const std::string xml = write_mitsuba_xml(
        scene, output, fs::path(output).stem().string() + "_files",
        [&](const SceneFile& file) { write_file((folder / file.name).string(), file.bytes); });
    write_file(output, xml);
}

}  // namespace

void add_convert_command(CLI::App& app) {
    struct Options {
        SceneOptions scene;
        std::string output;
        bool keep_plugins = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App& c = *app.add_subcommand("convert", "Write a scene as XML of Mitsuba 3");
    c.add_option("SCENE", options->scene.file, "Scene file (.xml, .pbrt, .gltf, .glb, .usd)")
        ->required();
    c.add_option("OUTPUT", options->output,
                 "XML file to write; meshes and images go to a folder beside it")
        ->required();
    c.add_option("-D,--define", options->scene.defines,
                 "Value of a scene parameter, name=value; repeatable")
        ->allow_extra_args(false);
    c.add_flag("--lenient", options->scene.lenient,
               "Leave out what cannot be read, with a warning for each case");
    c.add_flag("--keep-plugins", options->keep_plugins,
               "Keep plug-ins and parameters that Mitsuba 3 does not have, for use with etendue");
    c.callback([options] { convert(options->scene, options->output, options->keep_plugins); });
}

}  // namespace etendue
