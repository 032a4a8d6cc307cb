#pragma once
// The options of a command in groups, of which --help shows those that everybody needs first.

#include <initializer_list>

namespace CLI {
class App;
}

namespace etendue {

inline constexpr const char* kForExperts = "For experts";

/// Moves these options of the command to a group. Groups are shown in the order of their first options.
void set_group(CLI::App& command, const char* group, std::initializer_list<const char*> names);

}  // namespace etendue
