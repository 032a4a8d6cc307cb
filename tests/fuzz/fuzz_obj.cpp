// Any bytes as an .obj file: the result must be a mesh or a SceneError.

#include "readers/obj.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    try {
        etendue::parse_obj({reinterpret_cast<const char*>(data), size}, "fuzz.obj");
    } catch (const etendue::SceneError&) {
    }
    return 0;
}
