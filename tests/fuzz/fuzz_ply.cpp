// Any bytes as a .ply file: a mesh or a SceneError, nothing else.

#include "readers/ply.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    try {
        etendue::parse_ply({reinterpret_cast<const char*>(data), size}, "fuzz.ply");
    } catch (const etendue::SceneError&) {
    }
    return 0;
}
