// Any bytes as a .serialized file, and as the uncompressed contents of a well-formed one, which mutations of compressed
// data rarely reach: the result must be a mesh or a SceneError.

#include <zlib.h>

#include "fuzz_target.h"
#include "readers/serialized.h"

namespace etendue::fuzz {
namespace {

void parse(std::string_view bytes) {
    try {
        parse_serialized(bytes, "fuzz.serialized", 0);
    } catch (const SceneError&) {
    }
}

std::string as_only_mesh(std::string_view contents) {
    using namespace std::string_literals;
    std::string file = "\x1c\x04\x04\x00"s;
    uLongf packed = compressBound(contents.size());
    file.resize(file.size() + packed);
    compress2(reinterpret_cast<Bytef*>(&file[4]), &packed,
              reinterpret_cast<const Bytef*>(contents.data()), contents.size(), Z_NO_COMPRESSION);
    file.resize(4 + packed);
    const std::string offset(8, '\0'), count = "\x01\x00\x00\x00"s;
    return file + offset + count;
}

void run(std::string_view bytes) {
    parse(bytes);
    parse(as_only_mesh(bytes));
}

template <class T>
void put(std::string& bytes, std::initializer_list<T> values) {
    for (T v : values) bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
}

/// The contents of a mesh in either precision, and a file.
std::vector<std::string> seeds() {
    std::string floats, doubles;
    put<uint32_t>(floats, {0x1001});
    put<uint32_t>(doubles, {0x2002});
    for (std::string* s : {&floats, &doubles}) {
        *s += std::string("mesh\0", 5);
        put<uint64_t>(*s, {3, 1});
    }
    put<float>(floats, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1});
    put<double>(doubles, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1});
    for (std::string* s : {&floats, &doubles}) put<uint32_t>(*s, {0, 1, 2});
    return {floats, doubles, as_only_mesh(floats)};
}

const Register kRegister({.name = "serialized", .run = run, .seeds = seeds});

}  // namespace
}  // namespace etendue::fuzz
