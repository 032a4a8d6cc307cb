// Any bytes as a pbrt scene: a description or a SceneError, nothing else, and no file is touched. The included files are
// the text itself and a spectrum, so that these directives are reached, too.

#include <cstdint>
#include <string_view>

#include "readers/pbrt.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    // Subdivision of a few triangles may fill the memory without an error.
    if (text.find("levels") != text.npos) return 0;
    etendue::ReadOptions options;
    options.lenient = size % 2 == 1;
    options.read_file = [text](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".spd")) return "400 1\n700 2\n";
        if (path.ends_with(".pbrt")) return std::string(text);
        return {};
    };
    try {
        etendue::dump(etendue::parse_pbrt(text, "fuzz.pbrt", options));
    } catch (const etendue::SceneError&) {
    }
    return 0;
}
