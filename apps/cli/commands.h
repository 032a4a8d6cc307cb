#pragma once
// The subcommands of the program. Each adds its options and a callback; what goes wrong is thrown as an exception,
// printed by main() as one message.

namespace CLI {
class App;
}

namespace etendue {

void add_render_command(CLI::App& app);
void add_info_command(CLI::App& app);
void add_compare_command(CLI::App& app);
void add_diff_command(CLI::App& app);
void add_tonemap_command(CLI::App& app);
void add_list_command(CLI::App& app);
void add_verify_command(CLI::App& app);

}  // namespace etendue
