// Any bytes as a Mitsuba scene.

#include "fuzz_scene_text.h"
#include "readers/mitsuba_xml.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view text) {
    run_scene_text(text, ".xml", parse_mitsuba_xml);
}

const Register kRegister({.name = "mitsuba_xml",
                          .run = run,
                          .extension = ".xml",
                          .folders = {"scenes", "tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
