#include <cstdio>
#include <new>

#include <CLI/CLI.hpp>

#include "commands.h"

int main(int argc, char** argv) {
    CLI::App app{"etendue: unbiased light transport with reused light paths", "etendue"};
    app.set_version_flag("--version", ETENDUE_VERSION);
    app.require_subcommand(1);
    etendue::add_render_command(app);
    etendue::add_info_command(app);
    etendue::add_convert_command(app);
    etendue::add_compare_command(app);
    etendue::add_diff_command(app);
    etendue::add_tonemap_command(app);
    etendue::add_paths_command(app);
    etendue::add_list_command(app);
    etendue::add_verify_command(app);
    etendue::add_studio_command(app);
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& e) {
        return app.exit(e);
    } catch (const CLI::Error& e) {
        // One line that points to --help, instead of printing all of it.
        std::fprintf(stderr, "etendue: %s (see etendue --help)\n", e.what());
        return 2;
    } catch (const std::bad_alloc&) {
        std::fprintf(stderr, "etendue: not enough memory\n");
        return 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "etendue: %s\n", e.what());
        return 1;
    }
    return 0;
}
