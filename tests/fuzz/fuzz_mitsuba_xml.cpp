// Any bytes as a Mitsuba scene: the result must be a description or a SceneError, and no file is accessed. Included
// files are the text itself and a spectrum, so that these elements are reached as well.

#include <cstdint>
#include <string_view>

#include "readers/mitsuba_xml.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    etendue::ReadOptions options;
    options.lenient = size % 2 == 1;
    options.read_file = [text](const std::string& path) -> std::optional<std::string> {
        if (path.ends_with(".spd")) return "400 1\n700 2\n";
        if (path.ends_with(".xml")) return std::string(text);
        return {};
    };
    try {
        etendue::dump(etendue::parse_mitsuba_xml(text, "fuzz.xml", options));
    } catch (const etendue::SceneError&) {
    }
    return 0;
}
