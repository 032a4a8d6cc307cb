#include "scene/plugin_lookup.h"

#include <fmt/format.h>

#include "scene/shape_registry.h"

namespace etendue {

void PluginLookup::warn(const SourceLocation& where, const std::string& message) {
    warnings_.push_back(SceneError(where, message).what());
}

void PluginLookup::problem(const SourceLocation& where, const std::string& message) {
    if (!lenient_) throw SceneError(where, message);
    warn(where, message + " (left out)");
}

void PluginLookup::check(int index, const PluginInfo& info) {
    check_params(description_, index, info,
                 [&](const SourceLocation& where, const std::string& m) { problem(where, m); });
}

void PluginLookup::report_unknown(int index, std::vector<std::string>& known) {
    const SceneObject& o = object(index);
    if (o.category == "shape")
        for (const PluginInfo& g : group_infos()) known.push_back(g.name);
    const std::string near = nearest_name(o.type, known);
    problem(o.where, near.empty() ? fmt::format("unknown {} \"{}\" (known: {})", o.category, o.type,
                                                fmt::join(known, ", "))
                                  : fmt::format("unknown {} \"{}\" (did you mean \"{}\"?)",
                                                o.category, o.type, near));
}

}  // namespace etendue
