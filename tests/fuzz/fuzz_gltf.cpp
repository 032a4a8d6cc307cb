// Any bytes as a glTF scene: the result must be a description or a SceneError, and no file is accessed. Buffers are the
// text itself.

#include "fuzz_target.h"
#include "readers/gltf.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    ReadOptions options;
    options.lenient = bytes.size() % 2 == 1;
    options.read_file = [bytes](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".bin")) return std::string(bytes);
        return {};
    };
    try {
        dump(parse_gltf(bytes, "fuzz.gltf", options));
    } catch (const SceneError&) {
    }
}

/// A .glb file.
std::vector<std::string> seeds() {
    std::string json =
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
        R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36}],)"
        R"("bufferViews":[{"buffer":0,"byteLength":36}],)"
        R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3}]})";
    while (json.size() % 4 != 0) json += ' ';
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const auto word = [](uint32_t v) { return std::string(reinterpret_cast<const char*>(&v), 4); };
    return {"glTF" + word(2) + word(uint32_t(28 + json.size() + sizeof positions)) +
            word(uint32_t(json.size())) + "JSON" + json + word(sizeof positions) +
            std::string("BIN\0", 4) +
            std::string(reinterpret_cast<const char*>(positions), sizeof positions)};
}

const Register kRegister({.name = "gltf",
                          .run = run,
                          .seeds = seeds,
                          .extension = ".gltf",
                          .folders = {"tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
