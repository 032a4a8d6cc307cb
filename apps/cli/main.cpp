#include <fcntl.h>

#include <cerrno>
#include <cstdio>
#include <iostream>
#include <string>
#include <system_error>
#include <vector>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "hints.h"
#include "interrupt.h"
#include "messages.h"
#include "option_groups.h"
#include "usage_error.h"

namespace etendue {
namespace {

/// A standard stream that is closed gets a descriptor with which every use fails, so that no file takes its number and
/// receives what is printed.
void occupy_standard_streams() {
    for (const int stream : {0, 1, 2})
        if (::fcntl(stream, F_GETFD) < 0) ::open("/dev/null", stream == 0 ? O_WRONLY : O_RDONLY);
}

int run(CLI::App& app, const std::vector<std::string>& arguments) {
    try {
        // CLI11 takes them in reverse order.
        app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
    } catch (const CLI::Success& e) {
        return app.exit(e);
    } catch (const CLI::Error& e) {
        // One line that points to --help, instead of printing all of it.
        message("etendue: {}\n", refusal(app, arguments, e.what()));
        return 2;
    } catch (const UsageError& e) {
        message("etendue: {}\n", refusal(app, arguments, e.what()));
        return 2;
    } catch (const std::exception&) {
        print_failure();
        return 1;
    }
    return 0;
}

/// What is printed may be lost as late as here.
bool is_output_complete() {
    std::cout.flush();
    return std::fflush(stdout) == 0 && !std::ferror(stdout) && std::cout.good();
}

}  // namespace
}  // namespace etendue

int main(int argc, char** argv) {
    using namespace etendue;
    occupy_standard_streams();
    end_by_signals();
    CLI::App app{"etendue: unbiased light transport with reused light paths", "etendue"};
    app.set_version_flag("--version", ETENDUE_VERSION);
    app.require_subcommand(1);
    add_render_command(app);
    add_studio_command(app);
    add_info_command(app);
    add_list_command(app);
    add_tonemap_command(app);
    add_denoise_command(app);
    add_diff_command(app);
    add_compare_command(app);
    add_convert_command(app);
    add_merge_command(app);
    add_paths_command(app);
    add_verify_command(app);
    for (const char* name : {"convert", "merge", "paths", "verify"})
        app.get_subcommand(name)->group(kForExperts);
    app.footer("First picture: etendue SCENE -o picture.png --time 30. Methods and their "
               "parameters: etendue list "
               "integrators. Options of a command: etendue COMMAND --help.");
    const int status = run(app, with_usual_words(app, {argv + 1, argv + argc}));
    errno = 0;
    if (is_output_complete() || status != 0) return status;
    message("etendue: cannot write to standard output{}\n",
            errno != 0 ? ": " + std::generic_category().message(errno) : "");
    return 1;
}
