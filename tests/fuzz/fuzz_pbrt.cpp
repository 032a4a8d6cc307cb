// Any bytes as a pbrt scene.

#include "fuzz_scene_text.h"
#include "readers/pbrt.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view text) {
    run_scene_text(text, ".pbrt", parse_pbrt);
}

const Register
    kRegister({.name = "pbrt", .run = run, .extension = ".pbrt", .folders = {"tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
