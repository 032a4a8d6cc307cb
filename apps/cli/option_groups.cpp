#include "option_groups.h"

#include <CLI/CLI.hpp>

namespace etendue {

void set_group(CLI::App& command, const char* group, std::initializer_list<const char*> names) {
    for (const char* name : names) command.get_option(name)->group(group);
}

}  // namespace etendue
