// Any bytes as a glTF scene: the result must be a description or a SceneError, and no file is accessed. Buffers are the
// text itself.

#include <cstdint>
#include <string_view>

#include "readers/gltf.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    etendue::ReadOptions options;
    options.lenient = size % 2 == 1;
    options.read_file = [bytes](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".bin")) return std::string(bytes);
        return {};
    };
    try {
        etendue::dump(etendue::parse_gltf(bytes, "fuzz.gltf", options));
    } catch (const etendue::SceneError&) {
    }
    return 0;
}
