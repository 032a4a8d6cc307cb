// Any bytes as a .serialized file, and as the uncompressed contents of a well-formed one, which mutations of compressed
// data rarely reach: the result must be a mesh or a SceneError.

#include <zlib.h>

#include "readers/serialized.h"

namespace {

void parse(std::string_view bytes) {
    try {
        etendue::parse_serialized(bytes, "fuzz.serialized", 0);
    } catch (const etendue::SceneError&) {
    }
}

std::string as_only_mesh(const uint8_t* data, size_t size) {
    using namespace std::string_literals;
    std::string file = "\x1c\x04\x04\x00"s;
    uLongf packed = compressBound(size);
    file.resize(file.size() + packed);
    compress2(reinterpret_cast<Bytef*>(&file[4]), &packed, data, size, Z_NO_COMPRESSION);
    file.resize(4 + packed);
    const std::string offset(8, '\0'), count = "\x01\x00\x00\x00"s;
    return file + offset + count;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    parse({reinterpret_cast<const char*>(data), size});
    parse(as_only_mesh(data, size));
    return 0;
}
