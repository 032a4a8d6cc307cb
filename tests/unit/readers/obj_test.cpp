#include "readers/obj.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "expect_mesh.h"
#include "expect_scene_error.h"
#include "shared_scenes.h"

namespace etendue {
namespace {

MeshData parse_obj(std::string_view text, const MeshOptions& options = {}) {
    return parse_obj(text, "test.obj", options);
}

constexpr const char* kVertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
                                  "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.25\n"
                                  "vn 0 0 2\nvn 0 1 0\n";

TEST(Obj, PolygonsBecomeFans) {
    const MeshData m = parse_obj(std::string(kVertices) + "f 1 2 3 4\n");
    EXPECT_EQ(m.positions.size(), 4u);
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_TRUE(m.normals.empty());
    EXPECT_TRUE(m.uvs.empty());
}

TEST(Obj, VerticesAreNumberedInOrderOfFirstUse) {
    const MeshData m = parse_obj(std::string(kVertices) + "f 3 1 2\nf 3 4 1\n");
    EXPECT_EQ(m.positions[0], (Vec3{1, 1, 0}));
    EXPECT_EQ(m.positions[1], (Vec3{0, 0, 0}));
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 3, 1}}));
}

TEST(Obj, CornersAreUnifiedByAllThreeIndices) {
    const MeshData m = parse_obj(std::string(kVertices) +
                                 "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/2 4/4/2\nf 1/4/1 2/2/1 3/3/1\n");
    // 1/1/1 2/2/1 3/3/1 | 3/3/2 4/4/2 | 1/4/1
    ASSERT_EQ(m.positions.size(), 6u);
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 2}, {0, 3, 4}, {5, 1, 2}}));
    EXPECT_EQ(m.uvs[5], (Vec2{0, 0.25f}));
    EXPECT_EQ(m.normals[2], (Vec3{0, 0, 1}));
    EXPECT_EQ(m.normals[3], (Vec3{0, 1, 0}));
}

TEST(Obj, ManyCornersAtTheSamePositionsStayApart) {
    constexpr int kCount = 1000;
    std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (int i = 1; i <= kCount; ++i) {
        const std::string n = std::to_string(i);
        text += "vt " + n + " 0\nf 1/" + n + " 2/" + n + " 3/" + n + "\n";
    }
    const MeshData m = parse_obj(text);
    ASSERT_EQ(m.positions.size(), size_t(3 * kCount));
    for (size_t i = 0; i < m.uvs.size(); ++i) {
        EXPECT_EQ(m.uvs[i].x, float(i / 3 + 1));
        EXPECT_EQ(m.positions[i].x, i % 3 == 1 ? 1 : 0);
    }
}

TEST(Obj, NegativeIndicesCountBackFromHere) {
    const MeshData m = parse_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1\n"
                                 "v 5 0 0\nv 6 0 0\nv 5 1 0\nf -3//1 -2//1 -1//1\n");
    ASSERT_EQ(m.positions.size(), 6u);
    EXPECT_EQ(m.positions[0].x, 0);
    EXPECT_EQ(m.positions[3].x, 5);
}

TEST(Obj, FacesMayComeBeforeTheirVertices) {
    const MeshData m = parse_obj("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
    EXPECT_EQ(m.positions[1].x, 1);
}

TEST(Obj, CornersWithoutAnAttributeThatOthersHave) {
    const MeshData m = parse_obj(std::string(kVertices) + "f 1/2/2 2/2/2 3/2/2\nf 1 3 4\n");
    ASSERT_EQ(m.positions.size(), 6u);
    EXPECT_EQ(m.uvs[3], (Vec2{0, 0}));
    EXPECT_EQ(m.replaced_normals, 3u);
    EXPECT_NEAR(m.normals[3].z, 1, 1e-6f);
}

TEST(Obj, TextureCoordinatesFlipOnRequest) {
    const std::string text = std::string(kVertices) + "f 1/4 2/2 3/3\n";
    EXPECT_EQ(parse_obj(text).uvs[0].y, 0.25f);
    EXPECT_EQ(parse_obj(text, {.flip_tex_coords = true}).uvs[0].y, 0.75f);
}

TEST(Obj, OtherStatementsAreIgnored) {
    const MeshData m = parse_obj(
        "# comment\nmtllib a.mtl\no object\ng one two\ns off\nusemtl m\n\n   \n"
        "v 0 0 0 1.0\nv 1 0 0 1 0.5 0.5 0.5\n\tv  0\t1  0  # here\nvt 0.5 # only u\nvt 0 1 0\n"
        "l 1 2\np 1\nf 1/1 2/2 3/1 # a face\n");
    EXPECT_EQ(m.triangles.size(), 1u);
    EXPECT_EQ(m.uvs[0], (Vec2{0.5f, 0}));
}

TEST(Obj, LineEndings) {
    EXPECT_EQ(parse_obj("v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n").positions.size(), 3u);
    EXPECT_EQ(parse_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3").positions.size(), 3u);
    EXPECT_EQ(parse_obj("# old\rv 0 0 \\\r0\rv 1 0 0\r\rv 0 1 0\rf 1 2 3\r").positions.size(), 3u);
    expect_scene_error(4, "coordinate expected",
                       [] { parse_obj("v 0 0 0\r\r\nv 1 0 0\rv 1 x 0\r"); });
    EXPECT_EQ(parse_obj("v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n2 3\n").positions.size(), 3u);
    expect_scene_error(4, "coordinate expected", [] { parse_obj("v 0 \\\n 0 0\n\nv 1 x 0\n"); });
}

TEST(Obj, NumbersInAllTheirForms) {
    const MeshData m = parse_obj("v +1.5e+2 -.5 1E-3\nv 1e-42 1e-300 -1e-400\nv 0 1 0.\nf 1 2 3\n");
    EXPECT_EQ(m.positions[0], (Vec3{150, -0.5f, 1e-3f}));
    EXPECT_EQ(m.positions[1].y, 0);
    EXPECT_EQ(m.positions[1].z, 0);
    EXPECT_EQ(m.positions[2].y, 1);
    expect_scene_error(1, "is out of range", [] { parse_obj("v 1e400 0 0\n"); });
}

TEST(Obj, NormalsThatAreNotNumbersAreReplaced) {
    const MeshData m =
        parse_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn nan nan -nan\nvn 0 0 1\nf 1//1 2//2 3//2\n");
    EXPECT_EQ(m.replaced_normals, 1u);
    EXPECT_NEAR(m.normals[0].z, 1, 1e-6f);
}

TEST(Obj, ALargeFileIsReadFast) {
    constexpr int kSide = 225;  // 100,352 triangles
    std::string text;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            text +=
                "v " + std::to_string(x * 0.01) + " " + std::to_string(y * 0.01) + " 0.125000\n";
    for (int y = 0; y + 1 < kSide; ++y)
        for (int x = 0; x + 1 < kSide; ++x) {
            const int v = y * kSide + x + 1;
            text += "f " + std::to_string(v) + " " + std::to_string(v + 1) + " " +
                    std::to_string(v + kSide + 1) + " " + std::to_string(v + kSide) + "\n";
        }
    const auto begin = std::chrono::steady_clock::now();
    const MeshData m = parse_obj(text);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    EXPECT_EQ(m.triangles.size(), size_t(2 * (kSide - 1) * (kSide - 1)));
    EXPECT_EQ(m.positions.size(), size_t(kSide * kSide));
    // 0.03 s when measured; the limit leaves room for sanitizers and busy machines.
    EXPECT_LT(seconds.count(), 2);
}

TEST(Obj, AMissingFileIsNamed) {
    expect_scene_error(0, "cannot read", [] { read_obj("/no/such/file.obj"); });
    try {
        read_obj("/no/such/file.obj");
    } catch (const SceneError& e) {
        EXPECT_EQ(e.where().file, "/no/such/file.obj");
    }
}

TEST(Obj, SharedScenesLoad) {
    const auto files = testing::shared_files(".obj");
    if (files.empty()) GTEST_SKIP() << "shared scenes are absent";
    for (const std::string& file : files) {
        SCOPED_TRACE(file);
        expect_well_formed(read_obj(file));
    }
}

}  // namespace
}  // namespace etendue
