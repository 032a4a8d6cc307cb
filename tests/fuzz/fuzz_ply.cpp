// Any bytes as a .ply file: the result must be a mesh or a SceneError.

#include "readers/ply.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    try {
        etendue::parse_ply({reinterpret_cast<const char*>(data), size}, "fuzz.ply");
    } catch (const etendue::SceneError&) {
    }
    return 0;
}
