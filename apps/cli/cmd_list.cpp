#include <algorithm>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "integrator/integrator.h"
#include "readers/pbrt.h"
#include "render/aov.h"
#include "scene/builder.h"
#include "scene/settings.h"

namespace etendue {
namespace {

/// One entry of the list: plug-ins that differ only in their names.
struct Entry {
    std::string category;
    std::vector<std::string> names;
    std::string doc;
    std::vector<ParamInfo> params;
};

struct ListCommand {
    std::string category, name;
    bool markdown = false, json = false;

    void run() const;
};

bool same_param(const ParamInfo& a, const ParamInfo& b) {
    return std::strcmp(a.name, b.name) == 0 && a.kind == b.kind &&
           std::strcmp(a.fallback, b.fallback) == 0 && std::strcmp(a.doc, b.doc) == 0;
}

void add(std::vector<Entry>& entries, PluginInfo p, const std::string& doc) {
    // What a user needs comes first.
    std::stable_partition(p.params.begin(), p.params.end(),
                          [](const ParamInfo& q) { return !q.is_experimental; });
    if (!entries.empty()) {
        Entry& last = entries.back();
        if (last.category == p.category && last.doc == doc &&
            std::ranges::equal(last.params, p.params, same_param)) {
            last.names.push_back(p.name);
            return;
        }
    }
    entries.push_back({p.category, {p.name}, doc, p.params});
}

/// All plug-ins, grouped by category.
std::vector<Entry> all_entries() {
    std::vector<Entry> entries;
    for (const IntegratorEntry& e : integrator_registry()) add(entries, e.info, e.info.doc);
    for (const PluginInfo& p : scene_plugins()) add(entries, p, p.doc);
    for (const IntegratorAlias& a : integrator_aliases()) {
        PluginInfo p = a.info;
        p.category = "scene-integrator";
        add(entries, p, fmt::format("In a scene file: rendered by {}.", a.integrator));
    }
    for (const PluginInfo& p : pbrt_plugins()) add(entries, p, p.doc);
    for (const AovInfo& a : aov_registry()) add(entries, {"aov", a.name, a.doc, {}}, a.doc);
    return entries;
}

/// Keeps the entries of `category` and `name`, each of which may be empty for all. Throws std::runtime_error with the
/// known names where there is no such entry.
std::vector<Entry> choose(std::vector<Entry> entries, const std::string& category,
                          const std::string& name) {
    std::vector<std::string> categories, names;
    for (const Entry& e : entries) {
        if (categories.empty() || categories.back() != e.category) categories.push_back(e.category);
        if (e.category == category) names.insert(names.end(), e.names.begin(), e.names.end());
    }
    if (!category.empty() && names.empty())
        throw std::runtime_error(fmt::format("unknown category \"{}\" (known: {})", category,
                                             fmt::join(categories, ", ")));
    if (!name.empty() && std::ranges::find(names, name) == names.end())
        throw std::runtime_error(
            fmt::format("unknown {} \"{}\" (known: {})", category, name, fmt::join(names, ", ")));
    std::erase_if(entries, [&](const Entry& e) {
        return (!category.empty() && e.category != category) ||
               (!name.empty() && std::ranges::find(e.names, name) == e.names.end());
    });
    return entries;
}

void print_text(const std::vector<Entry>& entries) {
    std::string category;
    for (const Entry& e : entries) {
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
void print_markdown(const std::vector<Entry>& entries, bool headings) {
    std::string category;
    bool is_first = true;
    for (const Entry& e : entries) {
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

void print_json(const std::vector<Entry>& entries) {
    auto list = nlohmann::ordered_json::array();
    for (const Entry& e : entries) {
        auto params = nlohmann::ordered_json::array();
        for (const ParamInfo& q : e.params) {
            nlohmann::ordered_json p = {
                {"name", q.name}, {"type", kind_name(q.kind)}, {"doc", q.doc}};
            if (*q.fallback) p["default"] = q.fallback;
            if (q.is_experimental) p["experimental"] = true;
            params.push_back(p);
        }
        for (const std::string& name : e.names)
            list.push_back(
                {{"category", e.category}, {"name", name}, {"doc", e.doc}, {"parameters", params}});
    }
    fmt::print("{}\n", list.dump(2));
}

void ListCommand::run() const {
    const std::vector<Entry> entries = choose(all_entries(), category, name);
    if (json)
        print_json(entries);
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
    c.add_option("CATEGORY", command->category, "List only this category, e.g. bsdf");
    c.add_option("NAME", command->name, "List only this plug-in of the category, e.g. diffuse");
    CLI::Option* markdown = c.add_flag("--markdown", command->markdown, "Print Markdown");
    c.add_flag("--json", command->json, "Print JSON")->excludes(markdown);
    c.callback([command] { command->run(); });
}

}  // namespace etendue
