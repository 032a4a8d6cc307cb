#include "readers/ply.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "expect_mesh.h"
#include "expect_scene_error.h"
#include "readers/gzip.h"
#include "readers/mitsuba_writer.h"
#include "shared_scenes.h"

namespace etendue {
namespace {

MeshData parse_ply(std::string_view bytes, const MeshOptions& options = {}) {
    return parse_ply(bytes, "test.ply", options);
}

/// Appends the bytes of a number, in big-endian order if wanted.
template <class T>
void put_ply(std::string& bytes, T value, bool big_endian) {
    std::string raw(reinterpret_cast<const char*>(&value), sizeof(T));
    if (big_endian) std::reverse(raw.begin(), raw.end());
    bytes += raw;
}

constexpr const char* kXyz = "property float x\nproperty float y\nproperty float z\n";

TEST(Ply, AsciiWithNormalsAndTextureCoordinates) {
    const MeshData m =
        parse_ply("ply\nformat ascii 1.0\ncomment made by hand\nobj_info none\nelement vertex 4\n"
                  "property float x\nproperty float y\nproperty float z\n"
                  "property float nx\nproperty float ny\nproperty float nz\n"
                  "property float u\nproperty float v\nelement face 2\n"
                  "property list uchar int vertex_indices\nend_header\n"
                  "0 0 0 0 0 2 0 0.25\n1 0 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n0 1 0 0 0 1 0 1\n"
                  "3 0 1 2\n3 0 2 3\n");
    EXPECT_EQ(m.positions.size(), 4u);
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(m.normals[0], (Vec3{0, 0, 1}));
    EXPECT_EQ(m.uvs[0], (Vec2{0, 0.25f}));
}

TEST(Ply, PolygonsBecomeFansAndShorterListsAreDropped) {
    const MeshData m =
        parse_ply(std::string("ply\nformat ascii 1.0\nelement vertex 5\n") + kXyz +
                  "element face 3\nproperty list uchar int vertex_index\nend_header\n"
                  "0 0 0\n1 0 0\n2 1 0\n1 2 0\n0 1 0\n"
                  "5 0 1 2 3 4\n2 0 1\n4 0 1 2 4\n");
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{
                               {0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 1, 2}, {0, 2, 4}}));
    EXPECT_EQ(m.dropped_degenerate, 1u);
}

TEST(Ply, NamesOfTextureCoordinates) {
    const std::pair<const char*, const char*> names[] = {
        {"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
    for (const auto& [u, v] : names) {
        const std::string text = std::string("ply\nformat ascii 1.0\nelement vertex 3\n") +
                                 "property float " + v + "\n" + kXyz + "property float " + u +
                                 "\nelement face 1\nproperty list uchar int vertex_indices\n"
                                 "end_header\n.1 0 0 0 .2\n.3 1 0 0 .4\n.5 0 1 0 .6\n3 0 1 2\n";
        const MeshData m = parse_ply(text);
        ASSERT_EQ(m.uvs.size(), 3u) << u;
        EXPECT_EQ(m.uvs[1], (Vec2{0.4f, 0.3f}));
        EXPECT_EQ(parse_ply(text, {.flip_tex_coords = true}).uvs[1], (Vec2{0.4f, 0.7f}));
    }
}

/// The same mesh in both byte orders, with every type of number, and with elements and properties that are ignored.
class PlyBinary : public ::testing::TestWithParam<bool> {};

TEST_P(PlyBinary, AllTypesInAnyOrder) {
    const bool big = GetParam();
    std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                        "_endian 1.0\nelement camera 2\nproperty double focus\n"
                        "property list ushort short shots\n"
                        "element vertex 4\nproperty uchar red\nproperty double z\n"
                        "property short x\nproperty list int8 float32 weights\nproperty int8 y\n"
                        "element face 2\nproperty int32 group\n"
                        "property list uint16 uint32 vertex_indices\nproperty list uint8 float uv\n"
                        "element empty 1000000000000\nend_header\n";
    for (int i = 0; i < 2; ++i) {
        put_ply<double>(bytes, 35, big);
        put_ply<uint16_t>(bytes, 2, big);
        put_ply<int16_t>(bytes, -1, big);
        put_ply<int16_t>(bytes, 7, big);
    }
    const int xy[4][2] = {{-300, 0}, {300, 0}, {300, 100}, {-300, 100}};
    for (int i = 0; i < 4; ++i) {
        put_ply<uint8_t>(bytes, 255, big);
        put_ply<double>(bytes, 0.5 * i, big);
        put_ply<int16_t>(bytes, int16_t(xy[i][0]), big);
        put_ply<int8_t>(bytes, int8_t(i), big);
        for (int k = 0; k < i; ++k) put_ply<float>(bytes, 1, big);
        put_ply<int8_t>(bytes, int8_t(xy[i][1]), big);
    }
    for (const auto& face : {std::vector<uint32_t>{0, 1, 2, 3}, std::vector<uint32_t>{2, 1, 0}}) {
        put_ply<int32_t>(bytes, -5, big);
        put_ply<uint16_t>(bytes, uint16_t(face.size()), big);
        for (const uint32_t v : face) put_ply<uint32_t>(bytes, v, big);
        put_ply<uint8_t>(bytes, 1, big);
        put_ply<float>(bytes, 3, big);
    }
    const MeshData m = parse_ply(bytes);
    EXPECT_EQ(m.positions,
              (std::vector<Vec3>{{-300, 0, 0}, {300, 0, 0.5f}, {300, 100, 1}, {-300, 100, 1.5f}}));
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 2, 3}, {2, 1, 0}}));
    EXPECT_TRUE(m.uvs.empty());
    EXPECT_TRUE(m.normals.empty());

    // A file truncated at any byte is an error.
    const size_t body = bytes.find("end_header\n") + 11;
    for (size_t n = body; n < bytes.size(); ++n)
        EXPECT_THROW(parse_ply(std::string_view(bytes).substr(0, n)), SceneError) << n;
}

/// A binary file in the most frequent layout: floats, then faces with lengths of one byte and indices of four.
struct PlainMesh {
    bool big_endian;
    std::string bytes;
    size_t vertices, faces;  ///< Where they begin.

    PlainMesh(bool big, const std::vector<std::vector<uint32_t>>& polygons) : big_endian(big) {
        bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                "_endian 1.0\nelement vertex 5\n" + kXyz +
                "property uchar flags\nproperty float u\nproperty float v\nelement face " +
                std::to_string(polygons.size()) +
                "\nproperty list uchar uint vertex_indices\nend_header\n";
        vertices = bytes.size();
        const Vec2 corners[5] = {{0, 0}, {1, 0}, {2, 1}, {1, 2}, {0, 1}};
        for (const Vec2 p : corners) {
            for (const float x : {p.x, p.y, -1.5f}) put_ply(bytes, x, big);
            put_ply<uint8_t>(bytes, 3, big);
            for (const float x : {p.x / 2, p.y / 2}) put_ply(bytes, x, big);
        }
        faces = bytes.size();
        for (const auto& polygon : polygons) {
            put_ply(bytes, uint8_t(polygon.size()), big);
            for (const uint32_t v : polygon) put_ply(bytes, v, big);
        }
    }
};

TEST_P(PlyBinary, PolygonsAndTrianglesInAnyOrder) {
    const PlainMesh plain(GetParam(), {{0, 1, 2}, {0, 2, 3}, {0, 1, 2, 3, 4}, {1, 2}, {2, 3, 4}});
    const MeshData m = parse_ply(plain.bytes);
    EXPECT_EQ(m.positions,
              (std::vector<Vec3>{
                  {0, 0, -1.5f}, {1, 0, -1.5f}, {2, 1, -1.5f}, {1, 2, -1.5f}, {0, 1, -1.5f}}));
    EXPECT_EQ(m.uvs[2], (Vec2{1, 0.5f}));
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{
                               {0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {2, 3, 4}}));
    EXPECT_EQ(m.dropped_degenerate, 1u);
}

TEST_P(PlyBinary, IndicesOutOfRange) {
    for (const uint32_t bad : {5u, 0x80000000u, 0xffffffffu}) {
        const PlainMesh plain(GetParam(), {{0, 1, 2}, {0, 2, 3}, {0, 1, bad}, {0, 1, 2}});
        // Two triangles of 13 bytes, and a third.
        expect_scene_error(0,
                           fmt::format("vertex index {} must lie in [0, 4] (at byte {})", bad,
                                       plain.faces + 3 * 13),
                           [&] { parse_ply(plain.bytes); });
    }
}

TEST_P(PlyBinary, TruncatedAnywhere) {
    const PlainMesh plain(GetParam(), {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}});
    const auto cut = [&](size_t n) { parse_ply(std::string_view(plain.bytes).substr(0, n)); };
    for (size_t n = plain.vertices; n < plain.bytes.size(); ++n)
        EXPECT_THROW(cut(n), SceneError) << n;
    expect_scene_error(0,
                       fmt::format("the header declares 5 elements \"vertex\", more than the file "
                                   "can contain (at byte {})",
                                   plain.vertices),
                       [&] { cut(plain.faces - 1); });
    // The second index of the last face begins at its byte 5.
    expect_scene_error(0, fmt::format("the file ends early (at byte {})", plain.faces + 26 + 5),
                       [&] { cut(plain.faces + 26 + 7); });
}

TEST_P(PlyBinary, PositionThatIsNotFinite) {
    PlainMesh plain(GetParam(), {{0, 1, 2}});
    std::string nan;
    put_ply(nan, std::nanf(""), plain.big_endian);
    constexpr size_t kRecord = 21;
    plain.bytes.replace(plain.vertices + 3 * kRecord + 4, 4, nan);
    expect_scene_error(0,
                       fmt::format("position of vertex 3 is not finite (at byte {})",
                                   plain.vertices + 3 * kRecord),
                       [&] { parse_ply(plain.bytes); });
}

INSTANTIATE_TEST_SUITE_P(ByteOrders, PlyBinary, ::testing::Values(false, true),
                         [](const auto& order) { return order.param ? "Big" : "Little"; });

TEST(Ply, FacesMayComeBeforeTheirVertices) {
    const std::string text = std::string("ply\nformat ascii 1.0\nelement face 1\n") +
                             "property list uchar int vertex_indices\nelement vertex 3\n" + kXyz +
                             "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n";
    EXPECT_EQ(parse_ply(text).triangles.size(), 1u);
    std::string wrong = text;
    wrong.replace(wrong.find("3 0 1 2"), 7, "3 0 1 3");
    expect_scene_error(0, "triangle 0 refers to vertex 3", [&] { parse_ply(wrong); });
}

TEST(Ply, LineEndings) {
    const std::string text = std::string("ply\nformat ascii 1.0\nelement vertex 3\n") + kXyz +
                             "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
                             "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    std::string windows = text, old = text;
    for (size_t i = 0; (i = windows.find('\n', i)) != std::string::npos; i += 2)
        windows.insert(i, "\r");
    std::replace(old.begin(), old.end(), '\n', '\r');
    EXPECT_EQ(parse_ply(windows).triangles.size(), 1u);
    EXPECT_EQ(parse_ply(old).triangles.size(), 1u);
}

// Binary data may begin with the characters that end lines.
TEST(Ply, LineEndingsBeforeBinaryData) {
    for (const std::string end : {"\n", "\r\n", "\r"})
        for (const std::string first : {"\n", "\r", "\r\n", "x"}) {
            std::string bytes;
            for (const char* line :
                 {"ply", "format binary_little_endian 1.0", "element vertex 3", "property float x",
                  "property float y", "property float z", "element face 1",
                  "property list uchar int vertex_indices", "end_header"})
                bytes += line + end;
            const size_t body = bytes.size();
            for (const float x : {0, 0, 0, 1, 0, 0, 0, 1, 0}) put_ply(bytes, x, false);
            put_ply<uint8_t>(bytes, 3, false);
            for (const int32_t i : {0, 1, 2}) put_ply(bytes, i, false);
            bytes.replace(body, first.size(), first);
            const MeshData m = parse_ply(bytes);
            EXPECT_EQ(m.positions[1], (Vec3{1, 0, 0})) << end << first;
            EXPECT_EQ(m.triangles.size(), 1u) << end << first;
        }
}

TEST(Ply, WrittenMeshesAreReadAgain) {
    MeshData mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
    mesh.uvs = {{0.5f, 1}, {2, 3}, {4, 5}};
    mesh.second_uvs = {{6, 7}, {8, 9}, {10, 11}};
    mesh.colors = {{0.25f, 0.5f, 1}, {1, 0, 0}, {0, 1, 0}};
    mesh.alphas = {0, 0.5f, 1};
    mesh.triangles = {{0, 1, 2}};
    const MeshData read = parse_ply(write_ply(mesh));
    std::vector<std::string> arrays;
    for_each_vertex_array(mesh, [&](const char* name, const auto& values) {
        EXPECT_FALSE(values.empty()) << name;
        arrays.push_back(std::string(reinterpret_cast<const char*>(values.data()),
                                     values.size() * sizeof(values[0])));
    });
    size_t i = 0;
    for_each_vertex_array(read, [&](const char* name, const auto& values) {
        EXPECT_EQ(std::string(reinterpret_cast<const char*>(values.data()),
                              values.size() * sizeof(values[0])),
                  arrays[i++])
            << name;
    });
    EXPECT_EQ(read.triangles, mesh.triangles);
}

TEST(Ply, SharedScenesLoad) {
    const auto files = testing::shared_files(".ply");
    if (files.empty()) GTEST_SKIP() << "shared scenes are absent";
    for (const std::string& file : files) {
        SCOPED_TRACE(file);
        expect_well_formed(read_ply(file));
    }
}

TEST(Ply, FilesPackedByGzipAreUnpacked) {
    // "ply" and what follows it as `gzip -9n` packs them.
    EXPECT_TRUE(is_gzip(std::string_view("\x1f\x8b\x08", 3)));
    EXPECT_FALSE(is_gzip("ply\n"));
    const std::string packed("\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x2b\xc8\xa9\xe4"
                             "\x02\x00\x65\x66\x9e\x15\x04\x00\x00\x00",
                             24);
    EXPECT_EQ(unpack_gzip(packed, "a.ply.gz"), "ply\n");
    expect_scene_error(0, "damaged or cut short",
                       [&] { unpack_gzip(packed.substr(0, 12), "a.ply.gz"); });
}

}  // namespace
}  // namespace etendue
