// Any bytes as a Mitsuba scene that is converted, and that is built and rendered: a SceneError, or an image without values
// that are not finite.

#include <atomic>

#include "fuzz_target.h"
#include "math/vec.h"
#include "readers/mitsuba_writer.h"
#include "readers/mitsuba_xml.h"
#include "render/renderer.h"
#include "scene/builder.h"
#include "scene/plain_mitsuba.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view text) {
    // Bitmaps, meshes and spectra of the disk are out of reach.
    if (text.find("filename") != text.npos) return;
    ReadOptions options;
    options.lenient = text.size() % 2 == 1;
    try {
        SceneDescription plain = parse_mitsuba_xml(text, "fuzz.xml", options);
        make_plain_mitsuba(plain);
        write_mitsuba_xml(plain, "out.xml", "files", [](const SceneFile&) {});
    } catch (const SceneError&) {
    }
    try {
        BuildOptions build;
        build.lenient = options.lenient;
        build.resolution = {4, 4};
        const Scene scene = build_scene(parse_mitsuba_xml(text, "fuzz.xml", options), build);
        for (const char* method : {"path", "bdpt"}) {
            RenderSettings settings;
            settings.integrator = IntegratorSpec::parse(std::string(method) + ":max_depth=4");
            settings.threads = 1;
            settings.spp = 2;
            Renderer renderer(scene, settings);
            const std::atomic<bool> never{false};
            renderer.run([](const Progress&) {}, never);
            for (const Rgb c : renderer.film().image()) require(is_finite(c));
        }
    } catch (const SceneError&) {
    }
}

const Register kRegister({.name = "scene",
                          .run = run,
                          .mutations = 400,
                          .extension = ".xml",
                          .folders = {"scenes", "tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
