#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "json_text.h"
#include "render/plugin_list.h"
#include "scene/builder.h"
#include "scene/mitsuba_manual.h"
#include "scene/settings.h"

namespace etendue {
namespace {

struct ListCommand {
    std::string category, name;
    bool markdown = false, json = false, mitsuba = false;

    void run() const;
};

void print_text(const std::vector<PluginEntry>& entries) {
    std::string category;
    for (const PluginEntry& e : entries) {
        if (e.category != category) fmt::print("{}\n", category = e.category);
        fmt::print("  {}\n      {}\n", fmt::join(e.names, ", "), e.doc);
        for (const ParamInfo& q : e.params)
            fmt::print("      - {} ({}{}{}): {}\n", q.name, kind_name(q.kind),
                       *q.fallback ? fmt::format(", default {}", q.fallback) : "",
                       q.is_experimental ? ", experimental" : "", q.doc);
    }
}

std::string cell(const std::string& text) {
    std::string escaped;
    for (char c : text) escaped += c == '|' ? std::string("\\|") : std::string(1, c);
    return escaped;
}

void print_parameter_table(const std::vector<ParamInfo>& params) {
    if (params.empty()) return;
    fmt::print("\n| parameter | type | default | meaning |\n| --- | --- | --- | --- |\n");
    for (const ParamInfo& q : params)
        fmt::print("| `{}` | {} | {} | {}{} |\n", q.name, kind_name(q.kind), cell(q.fallback),
                   q.is_experimental ? "*Experimental.* " : "", cell(q.doc));
}

/// `headings` is false where the command line names one plug-in, whose page has its own heading.
void print_markdown(const std::vector<PluginEntry>& entries, bool headings) {
    std::string category;
    bool is_first = true;
    for (const PluginEntry& e : entries) {
        if (!is_first) fmt::print("\n");
        is_first = false;
        if (headings) {
            if (e.category != category) fmt::print("## {}\n\n", category = e.category);
            fmt::print("### {}\n\n", fmt::join(e.names, ", "));
        }
        fmt::print("{}\n", e.doc);
        print_parameter_table(e.params);
    }
}

void ListCommand::run() const {
    if (mitsuba) {
        std::vector<PluginInfo> plugins = scene_plugins();
        for (const IntegratorAlias& a : integrator_aliases()) plugins.push_back(a.info);
        fmt::print("{}", mitsuba_manual_table(plugins));
        return;
    }
    const std::vector<PluginEntry> entries = choose_plugins(plugin_list(), category, name);
    if (json)
        fmt::print("{}", json_text(to_json(entries)));
    else if (markdown)
        print_markdown(entries, name.empty());
    else
        print_text(entries);
}

}  // namespace

void add_list_command(CLI::App& app) {
    auto command = std::make_shared<ListCommand>();
    CLI::App& c = *app.add_subcommand(
        "list", "List integrators and all plug-ins of scene files, with parameters and defaults");
    CLI::Option* category =
        c.add_option("CATEGORY", command->category, "List only this category, e.g. bsdf");
    CLI::Option* name =
        c.add_option("NAME", command->name, "List only this plug-in of the category, e.g. diffuse");
    CLI::Option* markdown = c.add_flag("--markdown", command->markdown, "Print Markdown");
    CLI::Option* mitsuba = c.add_flag(
        "--mitsuba", command->mitsuba,
        "Print, in Markdown, the support of each plug-in and parameter in the manuals of Mitsuba "
        "0.6 and 3");
    CLI::Option* json = c.add_flag("--json", command->json, "Print JSON")->excludes(markdown);
    for (CLI::Option* other : {category, name, json}) mitsuba->excludes(other);
    c.callback([command] { command->run(); });
}

}  // namespace etendue
