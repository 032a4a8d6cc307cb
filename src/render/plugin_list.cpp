#include "render/plugin_list.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrator/integrator.h"
#include "readers/pbrt.h"
#include "render/aov.h"
#include "scene/builder.h"
#include "scene/settings.h"

namespace etendue {
namespace {

bool same_param(const ParamInfo& a, const ParamInfo& b) {
    return std::strcmp(a.name, b.name) == 0 && a.kind == b.kind &&
           std::strcmp(a.fallback, b.fallback) == 0 && std::strcmp(a.doc, b.doc) == 0;
}

void add(std::vector<PluginEntry>& entries, PluginInfo p, const std::string& doc) {
    // Experimental parameters come last.
    std::stable_partition(p.params.begin(), p.params.end(),
                          [](const ParamInfo& q) { return !q.is_experimental; });
    if (!entries.empty()) {
        PluginEntry& last = entries.back();
        if (last.category == p.category && last.doc == doc &&
            std::ranges::equal(last.params, p.params, same_param)) {
            last.names.push_back(p.name);
            return;
        }
    }
    entries.push_back({p.category, {p.name}, doc, p.params});
}

}  // namespace

std::vector<PluginEntry> plugin_list() {
    std::vector<PluginEntry> entries;
    for (const IntegratorEntry& e : integrator_registry()) add(entries, e.info, e.info.doc);
    for (const PluginInfo& p : scene_plugins()) add(entries, p, p.doc);
    for (const IntegratorAlias& a : integrator_aliases()) {
        PluginInfo p = a.info;
        p.category = "scene-integrator";
        add(entries, p,
            *a.integrator
                ? fmt::format("In a scene file: rendered by {}{}.", a.integrator,
                              a.is_substitute ? ", with a warning" : "")
                : "In a scene file: the integrator nested in it is used, with a warning.");
    }
    for (const PluginInfo& p : pbrt_plugins()) add(entries, p, p.doc);
    for (const AovInfo& a : aov_registry()) add(entries, {"aov", a.name, a.doc, {}}, a.doc);
    return entries;
}

std::vector<PluginEntry> choose_plugins(std::vector<PluginEntry> entries,
                                        const std::string& category, const std::string& name) {
    std::vector<std::string> categories, names;
    for (const PluginEntry& e : entries) {
        if (categories.empty() || categories.back() != e.category) categories.push_back(e.category);
        if (e.category == category) names.insert(names.end(), e.names.begin(), e.names.end());
    }
    if (!category.empty() && names.empty())
        throw std::runtime_error(fmt::format("unknown category \"{}\" (known: {})", category,
                                             fmt::join(categories, ", ")));
    if (!name.empty() && std::ranges::find(names, name) == names.end())
        throw std::runtime_error(
            fmt::format("unknown {} \"{}\" (known: {})", category, name, fmt::join(names, ", ")));
    std::erase_if(entries, [&](const PluginEntry& e) {
        return (!category.empty() && e.category != category) ||
               (!name.empty() && std::ranges::find(e.names, name) == e.names.end());
    });
    return entries;
}

nlohmann::ordered_json to_json(const std::vector<PluginEntry>& entries) {
    auto list = nlohmann::ordered_json::array();
    for (const PluginEntry& e : entries) {
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
    return list;
}

}  // namespace etendue
