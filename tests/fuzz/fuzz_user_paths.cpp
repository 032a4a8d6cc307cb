// Any bytes as a file of user paths: a std::runtime_error, or paths that are the same after they were written and read.

#include <stdexcept>

#include "fuzz_target.h"
#include "mcmc/user_paths.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    std::vector<GivenPath> paths;
    try {
        paths = parse_user_paths(std::string(bytes), "fuzz.json");
    } catch (const std::runtime_error&) {
        return;
    }
    const std::string text = to_json(paths);
    require(to_json(parse_user_paths(text, "again.json")) == text);
}

const Register kRegister({.name = "user_paths", .run = run});

}  // namespace
}  // namespace etendue::fuzz
