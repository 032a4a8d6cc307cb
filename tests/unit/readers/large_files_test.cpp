// Files that do not fit into memory, as bytes or as what they become: one message with the name of the file.

#include <filesystem>
#include <fstream>
#include <functional>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "error_of.h"
#include "limited_memory.h"
#include "math/hash.h"
#include "readers/mitsuba_writer.h"
#include "readers/obj.h"
#include "readers/ply.h"
#include "readers/scene_file.h"
#include "readers/serialized.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

struct Reader {
    const char* name;
    std::function<void(const std::string&)> read;
};

std::vector<Reader> readers() {
    const auto scene = [](const std::string& file) { read_scene_file(file); };
    return {{"a.obj", [](const std::string& file) { read_obj(file); }},
            {"a.ply", [](const std::string& file) { read_ply(file); }},
            {"a.serialized", [](const std::string& file) { read_serialized(file, 0); }},
            {"a.xml", scene},
            {"a.pbrt", scene},
            {"a.gltf", scene},
            {"a.glb", scene}};
}

/// More bytes than any machine has, of which the disk holds few.
TEST(LargeFiles, AreNamed) {
    const TemporaryFolder folder;
    for (const Reader& reader : readers()) {
        const fs::path file = folder.path() / reader.name;
        std::ofstream(file) << "\x1c\x04\x04";  // the beginning of a .serialized file
        fs::resize_file(file, uint64_t(1) << 40);
        if (fs::path(reader.name).extension() == ".serialized") {
            // One mesh, which is the whole file.
            std::fstream out(file, std::ios::in | std::ios::out | std::ios::binary);
            out.seekp((int64_t(1) << 40) - 4);
            out.write("\1\0\0\0", 4);
        }
        EXPECT_EQ(error_of([&] { reader.read(file); }),
                  file.string() + ": it does not fit into memory");
    }
}

/// Wherever memory ends, also in the middle of a file.
TEST(LargeFiles, ThatBecomeLargerAreNamed) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    constexpr uint32_t kVertices = 200'000;
    MeshData mesh;
    std::string obj, numbers;
    for (uint32_t i = 0; i < kVertices; ++i) {
        const Vec3 p{float(mix64(i) % 1000), float(mix64(i + 1) % 1000), float(i)};
        mesh.positions.push_back(p);
        obj += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
        numbers += fmt::format("{} {} {} ", p.x, p.y, p.z);
    }
    for (uint32_t i = 0; i + 2 < kVertices; ++i) {
        mesh.triangles.push_back({i, i + 1, i + 2});
        obj += fmt::format("f {} {} {}\n", i + 1, i + 2, i + 3);
    }
    const TemporaryFolder folder;
    const std::pair<const char*, std::string> files[] = {
        {"a.obj", obj},
        {"a.ply", write_ply(mesh)},
        {"a.pbrt", "WorldBegin\nShape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [" +
                       numbers + "]\n"}};
    for (const auto& [name, bytes] : files) {
        const std::string file = folder.path() / name;
        std::ofstream(file, std::ios::binary) << bytes;
        const std::vector<Reader> all = readers();
        const auto reader = std::find_if(all.begin(), all.end(), [&](const Reader& r) {
            return std::string_view(r.name) == fs::path(file).filename().string();
        });
        int failures = 0;
        for (uint64_t limit = 1; limit < 64; limit *= 2) {
            const std::string verdict = in_limited_memory(limit << 20, [&] { reader->read(file); });
            failures += !verdict.empty();
            EXPECT_TRUE(verdict.empty() || verdict.starts_with(file + ": ")) << verdict;
        }
        EXPECT_GT(failures, 0) << name;
    }
}

}  // namespace
}  // namespace etendue::test
