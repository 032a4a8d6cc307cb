#include "scene_options.h"

#include <charconv>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "option_groups.h"
#include "readers/scene_file.h"
#include "render/render_request.h"
#include "scene/builder.h"
#include "system/memory_limit.h"
#include "usage_error.h"

namespace etendue {
namespace {

/// Exactly `count` integers between separators; otherwise throws an error that names the option.
std::vector<int> parse_integers(const std::string& text, char separator, size_t count,
                                const char* option, const char* form) {
    std::vector<int> numbers;
    const char* at = text.data();
    const char* end = at + text.size();
    while (true) {
        int value = 0;
        const auto [next, error] = std::from_chars(at, end, value);
        if (error != std::errc()) break;
        numbers.push_back(value);
        at = next;
        if (at == end || *at != separator) break;
        ++at;
    }
    if (at != end || numbers.size() != count)
        throw UsageError(
            fmt::format("{} must have the form {}, but is \"{}\"", option, form, text));
    return numbers;
}

}  // namespace

void SceneOptions::add_to(CLI::App& command) {
    command.add_option("SCENE", file, "Scene file (.xml, .pbrt, .gltf, .glb, .usd)")->required();
    add_reading_options(command);
}

void SceneOptions::add_reading_options(CLI::App& command) {
    command
        .add_option("-D,--define", defines, "Value of a scene parameter, name=value; repeatable")
        ->allow_extra_args(false);
    command.add_flag("--lenient", lenient,
                     "Leave out or replace what cannot be rendered, with a warning for each case");
    command.add_flag("--watertight", watertight,
                     "Let no ray pass between adjacent triangles; rays take up to a fifth longer");
    command.add_option("--sensor", sensor,
                       "Sensor to use, by its number (from 0) or its name; see etendue info");
    command.add_option("--resolution", resolution, "Image size WxH instead of the file's");
    command.add_option("--crop", crop, "Part of the image to render: x,y,w,h in pixels");
    command
        .add_option("--memory", memory,
                    "Memory that the program may take, such as 4G (default: what is free)")
        ->type_name("SIZE");
    set_group(command, kForExperts, {"--watertight", "--memory"});
    command.parse_complete_callback([this] {
        if (memory.empty())
            limit_memory_to_available();
        else
            limit_memory(parse_memory_size(memory, "--memory"));
    });
}

SceneDescription read_scene(const SceneOptions& options) {
    check_scene_file(options.file);
    ReadOptions read;
    read.lenient = options.lenient;
    for (const std::string& d : options.defines) {
        const size_t equals = d.find('=');
        if (equals == std::string::npos || equals == 0)
            throw UsageError(fmt::format("-D must have the form name=value, but is \"{}\"", d));
        read.defines[d.substr(0, equals)] = d.substr(equals + 1);
    }
    try {
        return read_scene_file(options.file, read);
    } catch (const UnusedDefines& e) {
        throw std::runtime_error(fmt::format("-D: {}", e.what()));
    }
}

Scene build_scene(const SceneDescription& description, const SceneOptions& options) {
    BuildOptions build;
    build.lenient = options.lenient;
    build.sensor = options.sensor;
    build.accelerator.is_watertight = options.watertight;
    build.threads = options.threads;
    if (!options.resolution.empty()) {
        const auto v = parse_integers(options.resolution, 'x', 2, "--resolution", "WxH");
        if (v[0] < 1 || v[1] < 1 || v[0] > 65536 || v[1] > 65536)
            throw std::runtime_error(
                fmt::format("--resolution must lie between 1x1 and 65536x65536, but is \"{}\"",
                            options.resolution));
        build.resolution = {v[0], v[1]};
    }
    if (!options.crop.empty()) {
        const auto v = parse_integers(options.crop, ',', 4, "--crop", "x,y,w,h");
        build.crop = {v[0], v[1], v[2], v[3]};
    }
    return build_scene(description, build);
}

Scene load_scene(const SceneOptions& options) {
    return build_scene(read_scene(options), options);
}

void add_sampler_option(CLI::App& command, SamplerKind& sampler, const std::string& more) {
    command
        .add_option_function<std::string>(
            "--sampler",
            [&sampler](const std::string& name) { sampler = sampler_named(name, "--sampler"); },
            "independent or sobol" + more)
        ->default_str(to_string(sampler));
}

}  // namespace etendue
