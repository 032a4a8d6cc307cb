#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "commands.h"
#include "integrator/integrator.h"
#include "render/aov.h"
#include "scene/builder.h"

namespace etendue {
namespace {

void print(const PluginInfo& p) {
    fmt::print("  {}\n      {}\n", p.name, p.doc);
    for (const ParamInfo& q : p.params)
        fmt::print("      - {} ({}{}): {}\n", q.name, kind_name(q.kind), *q.fallback ? fmt::format(", default {}", q.fallback) : "", q.doc);
}

void list(const std::string& category) {
    std::vector<PluginInfo> plugins;
    for (const IntegratorEntry& e : integrator_registry()) plugins.push_back(e.info);
    for (const PluginInfo& p : scene_plugins()) plugins.push_back(p);
    std::vector<std::string> categories;
    for (const PluginInfo& p : plugins)
        if (categories.empty() || categories.back() != p.category) categories.push_back(p.category);
    categories.push_back("aov");
    if (!category.empty() && std::find(categories.begin(), categories.end(), category) == categories.end())
        throw std::runtime_error(fmt::format("there is no category \"{}\" (there are: {})", category, fmt::join(categories, ", ")));
    for (const std::string& c : categories) {
        if (!category.empty() && c != category) continue;
        fmt::print("{}\n", c);
        for (const PluginInfo& p : plugins)
            if (c == p.category) print(p);
        if (c == "aov")
            for (const AovInfo& a : aov_registry()) fmt::print("  {}\n      {}\n", a.name, a.doc);
    }
}

}  // namespace

void add_list_command(CLI::App& app) {
    auto category = std::make_shared<std::string>();
    CLI::App& c = *app.add_subcommand("list", "List integrators and everything scene files may name, with parameters and defaults");
    c.add_option("CATEGORY", *category, "Only this category, e.g. bsdf");
    c.callback([category] { list(*category); });
}

}  // namespace etendue
