#include "hints.h"

#include <algorithm>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "description/scene_description.h"
#include "integrator/integrator.h"
#include "readers/scene_file.h"

namespace etendue {
namespace {

/// What other programs call an option.
struct OtherOption {
    const char *other, *name;
};
constexpr OtherOption kOtherOptions[] = {
    {"samples", "spp"},       {"sample-count", "spp"},   {"samples-per-pixel", "spp"},
    {"nsamples", "spp"},      {"out", "output"},         {"outfile", "output"},
    {"file", "output"},       {"method", "integrator"},  {"algorithm", "integrator"},
    {"method", "methods"},    {"integrator", "methods"}, {"integrators", "methods"},
    {"size", "resolution"},   {"res", "resolution"},     {"width", "resolution"},
    {"height", "resolution"}, {"nthreads", "threads"},   {"cores", "threads"},
    {"jobs", "threads"},      {"seconds", "time"},       {"timeout", "time"},
    {"duration", "time"},     {"budget", "time"},        {"camera", "sensor"},
    {"silent", "quiet"},      {"layers", "aov"},         {"aovs", "aov"},
    {"window", "crop"},       {"param", "define"},       {"parameter", "define"}};

/// Commands that other programs have, or that say the same.
struct OtherCommand {
    const char *other, *name;
};
constexpr OtherCommand kOtherCommands[] = {
    {"run", "render"},        {"trace", "render"}, {"gui", "studio"},       {"view", "studio"},
    {"show", "info"},         {"stats", "info"},   {"export", "convert"},   {"import", "convert"},
    {"benchmark", "compare"}, {"error", "diff"},   {"metrics", "diff"},     {"png", "tonemap"},
    {"test", "verify"},       {"check", "verify"}, {"integrators", "list"}, {"plugins", "list"},
    {"methods", "list"},      {"ls", "list"}};

std::vector<std::string> commands_of(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::App* c : app.get_subcommands([](const CLI::App*) { return true; }))
        names.push_back(c->get_name());
    return names;
}

std::string did_you_mean(const std::string& text) {
    return text.empty() ? "" : fmt::format("; did you mean \"{}\"?", text);
}

std::string meant_command(const std::string& word, const std::vector<std::string>& commands) {
    for (const OtherCommand& c : kOtherCommands)
        if (word == c.other) return fmt::format("etendue {}", c.name);
    const std::string near = nearest_name(word, commands);
    return near.empty() ? "" : fmt::format("etendue {}", near);
}

/// The long option of `command` that an unknown one probably means; empty if none is near.
std::string meant_option(const CLI::App& command, std::string word) {
    word.erase(0, word.find_first_not_of('-'));
    word.resize(std::min(word.size(), word.find('=')));
    std::ranges::replace(word, '_', '-');
    std::vector<std::string> known;
    for (const CLI::Option* o : command.get_options())
        for (const std::string& name : o->get_lnames()) known.push_back(name);
    const auto has = [&](const std::string& name) {
        return std::ranges::find(known, name) != known.end();
    };
    if (has(word)) return "--" + word;
    for (const OtherOption& o : kOtherOptions)
        if (word == o.other && has(o.name)) return std::string("--") + o.name;
    const std::string near = nearest_name(word, known);
    return near.empty() ? "" : "--" + near;
}

/// The name of the parameter of integrators that an unknown option has; empty if none has it.
std::string integrator_param(std::string word) {
    word.erase(0, word.find_first_not_of('-'));
    word.resize(std::min(word.size(), word.find('=')));
    std::ranges::replace(word, '-', '_');
    for (const IntegratorEntry& e : integrator_registry())
        for (const ParamInfo& p : e.info.params)
            if (word == p.name) return word;
    return "";
}

/// The first argument that looks like an option, but is none of `command`.
std::string unknown_option(const CLI::App& command, const std::vector<std::string>& arguments) {
    for (const std::string& a : arguments) {
        if (a.size() < 2 || a[0] != '-') continue;
        const bool is_long = a[1] == '-';
        // A short option may be followed by its value; a negative number is a value.
        if (!is_long && (a[1] == '.' || (a[1] >= '0' && a[1] <= '9'))) continue;
        const std::string name = is_long ? a.substr(0, a.find('=')) : a.substr(0, 2);
        const auto options = command.get_options();
        if (name != "--" && std::ranges::none_of(
                                options, [&](const CLI::Option* o) { return o->check_name(name); }))
            return a;
    }
    return "";
}

}  // namespace

std::vector<std::string> with_usual_words(const CLI::App& app, std::vector<std::string> arguments) {
    if (arguments.empty()) return arguments;
    // A scene, before or after options, without a command.
    const std::vector<std::string> commands = commands_of(app);
    const auto is_command = [&](const std::string& a) {
        return std::ranges::find(commands, a) != commands.end();
    };
    if (is_scene_file_name(arguments[0]) ||
        (arguments[0].starts_with('-') && std::ranges::any_of(arguments, is_scene_file_name) &&
         std::ranges::none_of(arguments, is_command)))
        arguments.insert(arguments.begin(), "render");
    if (arguments[0] == "version") arguments[0] = "--version";
    if (arguments[0] == "help") {
        arguments.erase(arguments.begin());
        arguments.insert(arguments.begin() + (arguments.empty() ? 0 : 1), "--help");
    }
    return arguments;
}

std::string refusal(const CLI::App& app, const std::vector<std::string>& arguments,
                    const std::string& error) {
    const std::vector<std::string> commands = commands_of(app);
    if (arguments.empty())
        return fmt::format("expected a command: {} (see etendue --help)",
                           fmt::join(commands, ", "));
    const std::string& first = arguments[0];
    if (!first.starts_with('-') && std::ranges::find(commands, first) == commands.end()) {
        const std::string meant = meant_command(first, commands);
        return fmt::format("there is no command \"{}\"{} (see etendue --help)", first,
                           meant.empty() ? fmt::format("; there are: {}", fmt::join(commands, ", "))
                                         : did_you_mean(meant));
    }
    if (first.starts_with('-')) {
        const auto command = std::ranges::find_if(arguments, [&](const std::string& a) {
            return std::ranges::find(commands, a) != commands.end();
        });
        return command == arguments.end()
                   ? fmt::format("{} (see etendue --help)", error)
                   : fmt::format("{}; options follow the command: etendue {} ... (see etendue {} "
                                 "--help)",
                                 error, *command, *command);
    }
    const CLI::App& command = *app.get_subcommand(first);
    const std::string unknown = unknown_option(command, {arguments.begin() + 1, arguments.end()});
    const std::string help = fmt::format(" (see etendue {} --help)", first);
    if (unknown.empty()) return error + help;
    if (const std::string param = integrator_param(unknown); !param.empty())
        return fmt::format("{} has no option \"{}\"; it is a parameter of integrators: -i "
                           "INTEGRATOR:{}=...{}",
                           first, unknown, param, help);
    return fmt::format("{} has no option \"{}\"{}{}", first, unknown,
                       did_you_mean(meant_option(command, unknown)), help);
}

}  // namespace etendue
