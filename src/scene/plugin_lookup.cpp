#include "scene/plugin_lookup.h"

#include <fmt/format.h>

#include "scene/mitsuba_manual.h"
#include "scene/shape_registry.h"

namespace etendue {

void PluginLookup::warn(const SourceLocation& where, const std::string& message) {
    warnings_.push_back(SceneError(where, message).what());
}

void PluginLookup::problem(const SourceLocation& where, const std::string& message,
                           const std::string& instead) {
    if (!lenient_) throw SceneError(where, message);
    ++left_out_;
    warn(where, fmt::format("{} ({})", message, instead));
}

std::vector<std::string> PluginLookup::warnings() const {
    std::vector<std::string> all = warnings_;
    if (left_out_ > 0)
        all.push_back(
            fmt::format("{} left out or replaced: the image differs from what the scene describes",
                        left_out_ == 1 ? "one thing is" : fmt::format("{} things are", left_out_)));
    return all;
}

void PluginLookup::check(int index, const PluginInfo& info) {
    check_params(
        description_, index, info,
        [&](const SourceLocation& where, const std::string& m) { problem(where, m); },
        [&](const std::string& name) -> std::optional<ForeignParam> {
            const ManualNote* note = find_manual_note(info.category, info.name, name);
            if (!note) return {};
            return ForeignParam{note->is_accepted, note->text};
        });
}

void PluginLookup::report_unknown(int index, std::vector<std::string>& known) {
    const SceneObject& o = object(index);
    if (const ManualEntry* entry = find_manual_entry(o.category, o.type); entry && entry->refused)
        return problem(o.where, fmt::format("{} \"{}\" is not supported: {}", o.category, o.type,
                                            entry->refused));
    if (o.category == "shape")
        for (const PluginInfo& g : group_infos()) known.push_back(g.name);
    const std::string near = nearest_name(o.type, known);
    problem(o.where, near.empty() ? fmt::format("unknown {} \"{}\" (known: {})", o.category, o.type,
                                                fmt::join(known, ", "))
                                  : fmt::format("unknown {} \"{}\" (did you mean \"{}\"?)",
                                                o.category, o.type, near));
}

}  // namespace etendue
