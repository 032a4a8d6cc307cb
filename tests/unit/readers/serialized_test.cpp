#include "readers/serialized.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <string>

#include "expect_mesh.h"
#include "expect_scene_error.h"
#include "shared_scenes.h"

namespace etendue {
namespace {

constexpr uint32_t kNormals = 1, kTexcoords = 2, kColors = 8, kFaceNormals = 16;
constexpr uint32_t kSingle = 0x1000, kDouble = 0x2000;

template <class T>
void put(std::string& bytes, T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

struct Writer {
    uint16_t version = 4;
    std::vector<std::string> meshes;

    static std::string deflate(const std::string& plain) {
        uLongf size = compressBound(plain.size());
        std::string packed(size, '\0');
        compress(reinterpret_cast<Bytef*>(packed.data()), &size,
                 reinterpret_cast<const Bytef*>(plain.data()), plain.size());
        packed.resize(size);
        return packed;
    }
    std::string header() const {
        std::string bytes;
        put<uint16_t>(bytes, 0x041C);
        put<uint16_t>(bytes, version);
        return bytes;
    }
    /// Two triangles whose x is offset by the number of meshes before it.
    void add(uint32_t flags, const std::string& name, uint32_t last_index = 3) {
        std::string plain;
        put(plain, flags);
        if (version == 4) plain += name + '\0';
        put<uint64_t>(plain, 4);
        put<uint64_t>(plain, 2);
        const auto number = [&](double v) {
            flags& kDouble ? put<double>(plain, v) : put<float>(plain, float(v));
        };
        const double quad[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        for (const auto& p : quad) number(p[0] + double(meshes.size())), number(p[1]), number(0.5);
        if (flags & kNormals)
            for (int i = 0; i < 4; ++i) number(0), number(0), number(2);
        if (flags & kTexcoords)
            for (const auto& p : quad) number(p[0]), number(0.25 + p[1]);
        if (flags & kColors)
            for (int i = 0; i < 12; ++i) number(1);
        for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, last_index}) put(plain, i);
        meshes.push_back(header() + deflate(plain));
    }
    std::string file() const {
        std::string bytes, table;
        for (const std::string& m : meshes) {
            version == 4 ? put<uint64_t>(table, bytes.size())
                         : put<uint32_t>(table, uint32_t(bytes.size()));
            bytes += m;
        }
        bytes += table;
        put<uint32_t>(bytes, uint32_t(meshes.size()));
        return bytes;
    }
};

MeshData parse_serialized(std::string_view bytes, int index, const MeshOptions& options = {}) {
    return parse_serialized(bytes, "test.serialized", index, options);
}

class Serialized : public ::testing::TestWithParam<uint16_t> {};

TEST_P(Serialized, EveryMeshOfAFile) {
    Writer w{.version = GetParam(), .meshes = {}};
    w.add(kSingle, "first");
    w.add(kDouble | kNormals | kTexcoords, "second");
    w.add(kSingle | kNormals | kTexcoords | kColors | kFaceNormals, "third");
    const std::string bytes = w.file();
    const char* names[] = {"first", "second", "third"};
    for (int i = 0; i < 3; ++i) {
        const MeshData m = parse_serialized(bytes, i);
        EXPECT_EQ(m.name, GetParam() == 3 ? "test.serialized" : names[i]);
        EXPECT_EQ(m.positions[2], (Vec3{1 + float(i), 1, 0.5f}));
        EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 2, 3}}));
        EXPECT_EQ(m.normals.size(), i == 1 ? 4u : 0u);
        EXPECT_EQ(m.uvs.size(), i == 0 ? 0u : 4u);
        EXPECT_EQ(m.face_normals, i == 2);
        EXPECT_EQ(m.colors.size(), i == 2 ? 4u : 0u);
    }
    EXPECT_EQ(parse_serialized(bytes, 2).colors[1], (Vec3{1, 1, 1}));
    EXPECT_EQ(parse_serialized(bytes, 1).normals[3], (Vec3{0, 0, 1}));
    EXPECT_EQ(parse_serialized(bytes, 1).uvs[0], (Vec2{0, 0.25f}));
    EXPECT_EQ(parse_serialized(bytes, 1, {.flip_tex_coords = true}).uvs[0], (Vec2{0, 0.75f}));
    for (const int index : {-1, 3})
        expect_scene_error(0, "the file has 3", [&] { parse_serialized(bytes, index); });
}

// As old exporters wrote them, in either version.
TEST_P(Serialized, FlagsWithoutPrecisionMeanSingle) {
    Writer w{.version = GetParam(), .meshes = {}};
    w.add(0, "first");
    w.add(kNormals | kTexcoords, "second");
    for (int i = 0; i < 2; ++i) {
        const MeshData m = parse_serialized(w.file(), i);
        EXPECT_EQ(m.positions[2], (Vec3{1 + float(i), 1, 0.5f}));
        EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 2, 3}}));
    }
    EXPECT_EQ(parse_serialized(w.file(), 1).uvs[2], (Vec2{1, 1.25f}));
}

INSTANTIATE_TEST_SUITE_P(Versions, Serialized, ::testing::Values(3, 4),
                         [](const auto& version) { return std::to_string(version.param); });

TEST(SerializedErrors, NotSuchAFile) {
    expect_scene_error(0, "beyond the end", [] { parse_serialized("", 0); });
    expect_scene_error(0, "0x041C is missing", [] { parse_serialized("wavefront", 0); });
    Writer w{.version = 5, .meshes = {}};
    w.add(kSingle, "");
    expect_scene_error(0, "version 5", [&] { parse_serialized(w.file(), 0); });
}

TEST(SerializedErrors, DamagedTable) {
    Writer w;
    w.add(kSingle, "");
    std::string many = w.file(), far = w.file();
    many.replace(many.size() - 4, 4, "\xff\xff\xff\xff");
    expect_scene_error(0, "table of meshes", [&] { parse_serialized(many, 0); });
    far.replace(far.size() - 12, 8, "\xf0\xff\xff\xff\xff\xff\xff\xff");
    expect_scene_error(0, "beyond the end", [&] { parse_serialized(far, 0); });
    expect_scene_error(0, "table of meshes", [&] { parse_serialized(w.header(), 0); });
}

TEST(SerializedErrors, DamagedContents) {
    Writer w;
    w.add(kSingle | kDouble, "");
    w.add(kSingle, "", 4);
    const std::string bytes = w.file();
    expect_scene_error(0, "precision", [&] { parse_serialized(bytes, 0); });
    expect_scene_error(0, "refers to vertex 4", [&] { parse_serialized(bytes, 1); });
}

TEST(SerializedErrors, CountsBeyondTheData) {
    for (const uint64_t vertices : {uint64_t(1) << 32, uint64_t(0xFFFFFFFF)}) {
        Writer w;
        std::string plain;
        put<uint32_t>(plain, kSingle);
        plain += '\0';
        put<uint64_t>(plain, vertices);
        put<uint64_t>(plain, 1);
        w.meshes.push_back(w.header() + Writer::deflate(plain));
        EXPECT_THROW(parse_serialized(w.file(), 0), SceneError);
    }
}

TEST(SerializedErrors, EveryDamagedByteIsSurvived) {
    Writer w;
    w.add(kSingle | kNormals | kTexcoords, "mesh");
    const std::string bytes = w.file();
    int errors = 0;
    for (size_t i = 0; i < bytes.size(); ++i) {
        std::string damaged = bytes;
        damaged[i] = char(damaged[i] ^ 0x5a);
        try {
            expect_well_formed(parse_serialized(damaged, 0));
        } catch (const SceneError&) {
            ++errors;
        }
    }
    EXPECT_GT(errors, int(bytes.size() / 2));
}

TEST(SerializedErrors, SharedScenesLoad) {
    const auto files = testing::shared_files(".serialized");
    if (files.empty()) GTEST_SKIP() << "no shared scene has a .serialized file";
    for (const std::string& file : files) {
        SCOPED_TRACE(file);
        expect_well_formed(read_serialized(file, 0));
    }
}

}  // namespace
}  // namespace etendue
