// Any bytes as a pbrt scene: a description or a SceneError, nothing else, and no file is accessed. The included files are
// the text itself and a spectrum, so that these directives are reached, too.

#include "fuzz_target.h"
#include "readers/pbrt.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view text) {
    ReadOptions options;
    options.lenient = text.size() % 2 == 1;
    options.read_file = [text](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".spd")) return "400 1\n700 2\n";
        if (path.ends_with(".pbrt")) return std::string(text);
        return {};
    };
    try {
        dump(parse_pbrt(text, "fuzz.pbrt", options));
    } catch (const SceneError&) {
    }
}

const Register
    kRegister({.name = "pbrt", .run = run, .extension = ".pbrt", .folders = {"tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
