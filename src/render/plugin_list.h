#pragma once
// All plug-ins with their parameters, as the manual and `etendue list` show them.

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "description/params.h"

namespace etendue {

/// One entry of the list: plug-ins that differ only in their names.
struct PluginEntry {
    std::string category;
    std::vector<std::string> names;
    std::string doc;
    std::vector<ParamInfo> params;
};

/// All plug-ins, grouped by category.
std::vector<PluginEntry> plugin_list();
/// Keeps the entries of `category` and `name`, each of which may be empty for all. A category can be given in capitals, in
/// the plural, or by another usual word, such as "lights". Throws std::runtime_error with the known names, and with the
/// nearest one, where there is no such entry.
std::vector<PluginEntry> choose_plugins(std::vector<PluginEntry> entries,
                                        const std::string& category, const std::string& name);
/// One object for each name.
nlohmann::ordered_json to_json(const std::vector<PluginEntry>& entries);

}  // namespace etendue
