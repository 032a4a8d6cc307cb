// Any bytes as a .ply file: the result must be a mesh or a SceneError.

#include "fuzz_target.h"
#include "readers/ply.h"

namespace etendue::fuzz {
namespace {

void run(std::string_view bytes) {
    try {
        parse_ply(bytes, "fuzz.ply");
    } catch (const SceneError&) {
    }
}

template <class T>
void put(std::string& bytes, std::initializer_list<T> values) {
    for (T v : values) bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
}

/// A binary file: a triangle with normals, and a list of another length.
std::vector<std::string> seeds() {
    std::string file = "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n"
                       "property float y\nproperty float z\nproperty float nx\nproperty float ny\n"
                       "property float nz\nelement face 2\n"
                       "property list uchar int vertex_indices\nend_header\n";
    for (const float x : {0.0f, 1.0f, 2.0f, 3.0f}) put<float>(file, {x, x * x, 0, 0, 0, 1});
    put<uint8_t>(file, {3});
    put<int32_t>(file, {0, 1, 2});
    put<uint8_t>(file, {4});
    put<int32_t>(file, {0, 1, 2, 3});
    std::string big = file;
    big.replace(big.find("little"), 6, "big");
    return {file, big};
}

const Register kRegister(
    {.name = "ply", .run = run, .seeds = seeds, .extension = ".ply", .folders = {"tests/scenes"}});

}  // namespace
}  // namespace etendue::fuzz
