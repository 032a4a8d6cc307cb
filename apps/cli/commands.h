#pragma once
// The subcommands of the program. Each function adds its options and a callback to `app`. Callbacks report errors as
// exceptions, which main() prints as one message.

namespace CLI {
class App;
}

namespace etendue {

void add_render_command(CLI::App& app);
void add_info_command(CLI::App& app);
void add_convert_command(CLI::App& app);
void add_compare_command(CLI::App& app);
void add_diff_command(CLI::App& app);
void add_tonemap_command(CLI::App& app);
void add_denoise_command(CLI::App& app);
void add_merge_command(CLI::App& app);
void add_paths_command(CLI::App& app);
void add_list_command(CLI::App& app);
void add_verify_command(CLI::App& app);
void add_studio_command(CLI::App& app);

}  // namespace etendue
