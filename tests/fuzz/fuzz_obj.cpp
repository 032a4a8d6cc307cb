// Any bytes as an .obj file: the result must be a mesh or a SceneError.

#include "fuzz_target.h"
#include "readers/obj.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    try {
        parse_obj(bytes, "fuzz.obj");
    } catch (const SceneError&) {
    }
}

const Register
    kRegister({.name = "obj", .run = run, .extension = ".obj", .folders = {"tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
