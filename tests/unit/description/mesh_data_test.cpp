#include "description/mesh_data.h"

#include <gtest/gtest.h>

#include <limits>

#include "expect_scene_error.h"

namespace etendue {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

void expect_near(Vec3 a, Vec3 b, float tolerance) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

/// A quadrilateral bent along its diagonal 0-2.
MeshData bent_quad() {
    MeshData m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 1}};
    m.triangles = {{0, 1, 2}, {0, 2, 3}};
    return m;
}

TEST(VertexNormals, AreWeightedByAngle) {
    MeshData m = bent_quad();
    compute_vertex_normals(m);
    ASSERT_EQ(m.normals.size(), 4u);
    // Vertex 0: 45° of (0, 0, 1) and 60° of (1, -1, 1) / √3. Mitsuba 3.9 gives the same four
    // normals.
    expect_near(m.normals[0], {0.3705f, -0.3705f, 0.8518f}, 1e-4f);
    expect_near(m.normals[1], {0, 0, 1}, 1e-6f);
    expect_near(m.normals[2], {0.3705f, -0.3705f, 0.8518f}, 1e-4f);
    expect_near(m.normals[3], {0.5774f, -0.5774f, 0.5774f}, 1e-4f);
}

// The corner of a cube: three faces of 90° each, whichever way their squares are cut.
TEST(VertexNormals, DoNotDependOnTheTriangulation) {
    MeshData m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}, {1, 0, 1}};
    m.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 5, 3}, {5, 4, 3}, {0, 1, 5}, {1, 6, 5}};
    compute_vertex_normals(m);
    expect_near(m.normals[0], Vec3{-1, -1, -1} / std::sqrt(3.0f), 1e-6f);
}

TEST(VertexNormals, AreUnitVectorsWhereFacesCancelOrAreMissing) {
    MeshData m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}};
    m.triangles = {{0, 1, 2}, {0, 2, 1}};
    compute_vertex_normals(m);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::fabs(m.normals[i].z), 1, 1e-6f);
    expect_near(m.normals[3], {0, 0, 1}, 0);
}

TEST(VertexNormals, AreUnitVectorsAtExtremeScales) {
    for (const float scale : {1e-10f, 1e8f}) {
        MeshData m = bent_quad();
        for (Vec3& p : m.positions) p *= scale;
        compute_vertex_normals(m);
        expect_near(m.normals[0], {0.3705f, -0.3705f, 0.8518f}, 1e-4f);
    }
}

TEST(FinishMesh, DropsAndCountsTrianglesWithoutArea) {
    MeshData m = bent_quad();
    m.positions.push_back({2, 2, 0});
    m.positions.push_back({0.1f, 0.1f, 0.3f});
    m.positions.push_back({0.3f, 0.3f, 0.9f});
    m.triangles.push_back({0, 0, 1});
    m.triangles.push_back({0, 2, 4});
    finish_mesh(m, {}, {});
    EXPECT_EQ(m.triangles.size(), 2u);
    EXPECT_EQ(m.dropped_degenerate, 2u);
    EXPECT_TRUE(m.normals.empty());
}

TEST(FinishMesh, KeepsTrianglesOfAnySizeWhoseAreaIsANumber) {
    for (const float size : {1e-16f, 1e-12f, 1e10f, 1e17f}) {
        MeshData m = bent_quad();
        for (Vec3& p : m.positions) p *= size;
        finish_mesh(m, {}, {});
        EXPECT_EQ(m.triangles.size(), 2u) << size;
    }
}

TEST(FinishMesh, DropsVerticesOfNoTriangle) {
    MeshData m = bent_quad();
    const MeshData all = m;
    // One vertex before each of the quad: vertex v is at 2 v + 1 now.
    m.positions.clear();
    for (size_t i = 0; i < all.positions.size(); ++i) {
        m.positions.push_back({9, 9, float(i)});
        m.positions.push_back(all.positions[i]);
        for (const float x : {-1.0f, float(i)}) {
            m.normals.push_back({0, x < 0 ? -1.0f : 1.0f, x});
            m.uvs.push_back({x, x});
            m.colors.push_back({x, x, x});
            m.alphas.push_back(x);
            m.second_uvs.push_back({x, 2 * x});
        }
    }
    for (auto& t : m.triangles)
        for (uint32_t& v : t) v = 2 * v + 1;
    finish_mesh(m, {}, {});
    EXPECT_EQ(m.positions, all.positions);
    EXPECT_EQ(m.triangles, all.triangles);
    for_each_vertex_array(m, [&](const char* name, const auto& values) {
        EXPECT_EQ(values.size(), all.positions.size()) << name;
    });
    for (size_t i = 0; i < all.positions.size(); ++i) {
        EXPECT_GT(m.normals[i].y, 0);
        EXPECT_EQ(m.uvs[i].x, float(i));
        EXPECT_EQ(m.colors[i].x, float(i));
        EXPECT_EQ(m.alphas[i], float(i));
        EXPECT_EQ(m.second_uvs[i], (Vec2{float(i), 2 * float(i)}));
    }
}

TEST(FinishMesh, RejectsArraysOfOtherLengths) {
    MeshData m = bent_quad();
    m.alphas = {1};
    EXPECT_THROW(finish_mesh(m, {}, {}), SceneError);
    m.alphas.clear();
    m.uvs.resize(m.positions.size() + 1);
    EXPECT_THROW(finish_mesh(m, {}, {}), SceneError);
}

TEST(FinishMesh, NormalisesNormalsAndReplacesMissingOnes) {
    MeshData m = bent_quad();
    m.normals = {{0, 0, 0}, {0, 3, 4}, {kNan, 0, 1}, {2, 0, 0}};
    finish_mesh(m, {}, {});
    EXPECT_EQ(m.replaced_normals, 2u);
    expect_near(m.normals[0], {0.3705f, -0.3705f, 0.8518f}, 1e-4f);
    expect_near(m.normals[1], {0, 0.6f, 0.8f}, 1e-6f);
    expect_near(m.normals[2], {0.3705f, -0.3705f, 0.8518f}, 1e-4f);
    expect_near(m.normals[3], {1, 0, 0}, 1e-6f);
}

TEST(FinishMesh, FlipsTextureCoordinatesOnRequest) {
    MeshData m = bent_quad();
    m.uvs = {{0.25f, 0.75f}, {0, 0}, {0, 1}, {1, 3}};
    finish_mesh(m, {.flip_tex_coords = true}, {});
    EXPECT_EQ(m.uvs, (std::vector<Vec2>{{0.25f, 0.25f}, {0, 1}, {0, 0}, {1, -2}}));
}

TEST(FinishMesh, FaceNormalsLeaveNoVertexNormals) {
    MeshData m = bent_quad();
    m.normals.assign(4, {0, 0, 1});
    m.face_normals = true;
    finish_mesh(m, {}, {});
    EXPECT_TRUE(m.normals.empty());
}

TEST(FinishMesh, RejectsWhatCannotBeRendered) {
    const SourceLocation where{"mesh", 7};
    MeshData index = bent_quad();
    index.triangles[1][2] = 4;
    expect_scene_error(7, "triangle 1 refers to vertex 4", [&] { finish_mesh(index, {}, where); });
    MeshData position = bent_quad();
    position.positions[2].y = kNan;
    expect_scene_error(7, "position of vertex 2", [&] { finish_mesh(position, {}, where); });
    MeshData uv = bent_quad();
    uv.uvs = {{0, 0}, {0, kInf}, {0, 0}, {0, 0}};
    expect_scene_error(7, "texture coordinate of vertex 1", [&] { finish_mesh(uv, {}, where); });
    MeshData none = bent_quad();
    none.triangles.clear();
    expect_scene_error(7, "no triangles", [&] { finish_mesh(none, {}, where); });
    MeshData flat = bent_quad();
    flat.triangles = {{0, 0, 1}};
    expect_scene_error(7, "all triangles of the mesh have zero area",
                       [&] { finish_mesh(flat, {}, where); });
}

}  // namespace
}  // namespace etendue
