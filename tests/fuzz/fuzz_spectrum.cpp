// Any bytes as a spectrum, of a file and of an attribute: samples or a SceneError.

#include "fuzz_target.h"
#include "readers/mitsuba_values.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    try {
        parse_spectrum_file(bytes, "fuzz.spd");
    } catch (const SceneError&) {
    }
    try {
        parse_floats(bytes, {"fuzz", 0});
    } catch (const SceneError&) {
    }
}

const Register kRegister({.name = "spectrum", .run = run});

}  // namespace
}  // namespace etendue::fuzz
