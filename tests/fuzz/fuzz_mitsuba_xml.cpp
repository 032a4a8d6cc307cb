// Any bytes as a Mitsuba scene: the result must be a description or a SceneError, and no file is accessed. Included
// files are the text itself and a spectrum, so that these elements are reached as well.

#include "fuzz_target.h"
#include "readers/mitsuba_xml.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view text) {
    ReadOptions options;
    options.lenient = text.size() % 2 == 1;
    options.read_file = [text](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".spd")) return "400 1\n700 2\n";
        if (path.ends_with(".xml")) return std::string(text);
        return {};
    };
    try {
        dump(parse_mitsuba_xml(text, "fuzz.xml", options));
    } catch (const SceneError&) {
    }
}

const Register kRegister({.name = "mitsuba_xml",
                          .run = run,
                          .extension = ".xml",
                          .folders = {"scenes", "tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
