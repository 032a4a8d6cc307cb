#include "render/plugin_list.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrator/auto.h"
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
    add(entries, auto_entry().info, auto_entry().info.doc);
    for (const IntegratorEntry& e : integrator_registry()) add(entries, e.info, e.info.doc);
    for (const PluginInfo& p : scene_plugins()) add(entries, p, p.doc);
    for (const IntegratorAlias& a : integrator_aliases()) {
        PluginInfo p = a.info;
        p.category = "scene-integrator";
        add(entries, p,
            !*a.integrator ? "In a scene file: the integrator nested in it is used, with a warning."
            : a.is_substitute
                ? fmt::format("In a scene file: replaced by {}, with a warning.", a.integrator)
                : fmt::format(
                      "In a scene file: rendered by {}, all parameters of which can be given.",
                      a.integrator));
    }
    for (const PluginInfo& p : pbrt_plugins()) add(entries, p, p.doc);
    for (const AovInfo& a : aov_registry()) add(entries, {"aov", a.name, a.doc, {}}, a.doc);
    return entries;
}

namespace {

std::string lower_case(std::string text) {
    for (char& c : text)
        if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
    return text;
}

/// The category that `given` names in another way: in capitals, in the plural, or by another word. Empty if none.
std::string meant_category(const std::string& given, const std::vector<std::string>& categories) {
    static constexpr std::array<std::array<const char*, 2>, 14> kOtherWords = {
        {{"method", "integrator"},
         {"algorithm", "integrator"},
         {"renderer", "integrator"},
         {"material", "bsdf"},
         {"brdf", "bsdf"},
         {"light", "emitter"},
         {"lamp", "emitter"},
         {"camera", "sensor"},
         {"filter", "rfilter"},
         {"mesh", "shape"},
         {"geometry", "shape"},
         {"layer", "aov"},
         {"media", "medium"},
         {"image", "film"}}};
    std::string word = lower_case(given);
    const auto is_category = [&] {
        return std::ranges::find(categories, word) != categories.end();
    };
    if (is_category()) return word;
    if (word.ends_with("meshes")) word = "mesh";
    if (word.size() > 1 && word.ends_with('s')) word.pop_back();
    if (is_category()) return word;
    for (const auto& [other, category] : kOtherWords)
        if (word == other && std::ranges::find(categories, category) != categories.end())
            return category;
    return "";
}

/// Why `given` is no category, with what may be meant.
std::string no_category(const std::string& given, const std::vector<std::string>& categories,
                        const std::vector<PluginEntry>& entries) {
    for (const PluginEntry& e : entries)
        for (const std::string& name : e.names)
            if (lower_case(name) == lower_case(given))
                return fmt::format("\"{}\" is not a category, but the name of a plug-in (try "
                                   "\"list {} {}\")",
                                   given, e.category, name);
    const std::string near = nearest_name(given, categories);
    return fmt::format("unknown category \"{}\" ({}known: {})", given,
                       near.empty() ? "" : fmt::format("did you mean \"{}\"? ", near),
                       fmt::join(categories, ", "));
}

}  // namespace

std::vector<PluginEntry> choose_plugins(std::vector<PluginEntry> entries, const std::string& given,
                                        const std::string& name) {
    std::vector<std::string> categories, names;
    for (const PluginEntry& e : entries)
        if (categories.empty() || categories.back() != e.category) categories.push_back(e.category);
    const std::string category = given.empty() ? "" : meant_category(given, categories);
    if (!given.empty() && category.empty())
        throw std::runtime_error(no_category(given, categories, entries));
    for (const PluginEntry& e : entries)
        if (e.category == category) names.insert(names.end(), e.names.begin(), e.names.end());
    if (!name.empty() && std::ranges::find(names, name) == names.end()) {
        const std::string near = nearest_name(name, names);
        throw std::runtime_error(
            fmt::format("unknown {} \"{}\" ({}known: {})", category, name,
                        near.empty() ? "" : fmt::format("did you mean \"{}\"? ", near),
                        fmt::join(names, ", ")));
    }
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
