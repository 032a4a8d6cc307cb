// Rays for those who draw light paths; mirrors and slabs have closed forms.

#include "session/light_ray.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "mcmc/user_paths.h"
#include "session/scene_geometry.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

/// A lamp above a floor, and a mirror on the left.
std::string mirror_room_shapes() {
    return sensor("0,0,3", "0,-0.3,0", 16, "60") +
           rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>",
                     diffuse("0.5,0.5,0.5")) +
           rectangle("<rotate x=\"1\" angle=\"90\"/><scale value=\"0.3\"/>"
                     "<translate y=\"1\"/>",
                     "<emitter type=\"area\"/>") +
           rectangle("<scale value=\"2\"/><rotate y=\"1\" angle=\"90\"/><translate "
                     "x=\"-1\"/>",
                     "<bsdf type=\"conductor\"/>");
}
Scene mirror_room() {
    return build(mirror_room_shapes());
}

/// A slab of glass between y = 0 and y = 0.5, below a lamp and above a floor.
constexpr float kGlass = 1.5f, kTop = 0.5f;
Scene slab_room() {
    return build(sensor("0,0,5", "0,0,0", 16, "60") +
                 rectangle("<scale value=\"4\"/><rotate x=\"1\" angle=\"-90\"/><translate "
                           "y=\"-1\"/>",
                           diffuse("0.5,0.5,0.5")) +
                 rectangle("<scale value=\"0.3\"/><rotate x=\"1\" angle=\"90\"/><translate "
                           "y=\"2\"/>",
                           "<emitter type=\"area\"/>") +
                 "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"3\" y=\"0.25\" "
                 "z=\"3\"/><translate y=\"0.25\"/></transform><bsdf type=\"dielectric\"><float "
                 "name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>"
                 "</shape>");
}

TEST(Snap, MirrorIsThatOfTheMirroredPoint) {
    const Scene scene = mirror_room();
    const Vec3 lamp{0, 1, 0}, floor{0.3f, -1, 0.4f};
    // The mirror is the plane x = -1: the straight line to the mirrored point meets it.
    const Vec3 mirrored{-2 - floor.x, floor.y, floor.z};
    const float t = (-1 - lamp.x) / (mirrored.x - lamp.x);
    const Vec3 expected = lamp + (mirrored - lamp) * t;
    const std::vector<Vec3> given{lamp, expected + Vec3{0, 0.2f, -0.15f}, floor};
    const Snapped s = snap(scene, given, 1);
    ASSERT_EQ(s.problem, "");
    EXPECT_LT(length(s.points[1] - expected), 1e-4f);
    EXPECT_EQ(s.points[0].y, lamp.y);
    EXPECT_EQ(s.points[2].z, floor.z);
    GivenPath path{.name = "", .points = s.points, .cones = {1}, .radius = {}};
    EXPECT_EQ(check_user_path(scene, path).problem, "");
    path.points = given;
    EXPECT_NE(check_user_path(scene, path).problem, "");
}

/// Where coordinates are rounded to 5e-4, for a path of 0.1.
TEST(Snap, MirrorMayBeFarFromTheOrigin) {
    const Vec3 far{5000, 4000, -3000};
    const Scene scene =
        build(transformed(mirror_room_shapes(),
                          "<scale value=\"0.1\"/><translate x=\"5000\" y=\"4000\" z=\"-3000\"/>"));
    constexpr int kPaths = 40;
    for (int i = 0; i < kPaths; ++i) {
        const float s = 0.02f * float(i) / kPaths;
        const Vec3 lamp{s, 0.1f, 0}, floor{0.03f - s, -0.1f, 0.04f - s};
        const Vec3 mirrored{-0.2f - floor.x, floor.y, floor.z};
        const float t = (-0.1f - lamp.x) / (mirrored.x - lamp.x);
        const Vec3 expected = far + lamp + (mirrored - lamp) * t;
        const Snapped snapped =
            snap(scene,
                 std::vector<Vec3>{far + lamp, expected + Vec3{0, 0.01f, -0.008f}, far + floor}, 1);
        ASSERT_EQ(snapped.problem, "") << i;
        EXPECT_LT(length(snapped.points[1] - expected), 4e-3f) << i;
    }
}

TEST(Snap, SlabIsThatOfSnellsLaw) {
    const Scene scene = slab_room();
    const Vec3 lamp{0, 2, 0}, floor{1.2f, -1, 0.5f};
    // The horizontal distance covered, as a function of sin θ above the slab; by bisection.
    const float wanted = std::hypot(floor.x, floor.z);
    const auto covered = [&](double sine) {
        const double inner = sine / double(kGlass);
        return 2.5 * sine / std::sqrt(1 - sine * sine) +
               double(kTop) * inner / std::sqrt(1 - inner * inner);
    };
    double low = 0, high = 0.999;
    for (int i = 0; i < 80; ++i)
        (covered((low + high) / 2) < double(wanted) ? low : high) = (low + high) / 2;
    const double tangent = low / std::sqrt(1 - low * low);
    const Vec3 along = Vec3{floor.x, 0, floor.z} * (1 / wanted);
    const Vec3 above = along * float(1.5 * tangent) + Vec3{0, kTop, 0},
               below = along * float(double(wanted) - tangent);
    // From the second start, the miss is 0.56 after one Newton step, and 0.07 after two.
    const std::array<std::array<Vec3, 2>, 2> starts{{{Vec3{0.1f, 0, 0.05f}, Vec3{-0.08f, 0, 0.1f}},
                                                     {Vec3{0.5f, 0, -0.5f}, Vec3{0.5f, 0, -0.5f}}}};
    for (const auto& [of_above, of_below] : starts)
        for (const size_t index : {1u, 2u}) {
            const std::vector<Vec3> given{lamp, above + of_above, below + of_below, floor};
            const Snapped s = snap(scene, given, index);
            ASSERT_EQ(s.problem, "");
            EXPECT_LT(length(s.points[1] - above), 1e-5f);
            EXPECT_LT(length(s.points[2] - below), 1e-5f);
            const GivenPath path{.name = "", .points = s.points, .cones = {1}, .radius = {}};
            EXPECT_EQ(check_user_path(scene, path).problem, "");
        }
}

TEST(CheckUserPath, FollowsTwoFacingMirrors) {
    const Scene scene = build(
        sensor("0,0,3", "0,0,0", 16, "60") +
        rectangle("<scale value=\"9\"/><rotate y=\"1\" angle=\"90\"/><translate x=\"-1\"/>",
                  "<bsdf type=\"conductor\"/>") +
        rectangle("<scale value=\"9\"/><rotate y=\"1\" angle=\"-90\"/><translate x=\"1\"/>",
                  "<bsdf type=\"conductor\"/>") +
        rectangle("<scale value=\"0.3\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"4\"/>",
                  "<emitter type=\"area\"/>") +
        rectangle("<rotate x=\"1\" angle=\"-90\"/><translate y=\"-3\"/>", diffuse("0.5,0.5,0.5")));
    // A zigzag down from the lamp: 1 to the first mirror, then 2 from each to the next.
    GivenPath path{.name = "", .points = {{0, 4, 0}}, .cones = {1}, .radius = {}};
    const float down = 7.0f / 12;
    for (int i = 0; i < 6; ++i)
        path.points.push_back({i % 2 == 0 ? -1.0f : 1.0f, 4 - down * float(1 + 2 * i), 0});
    path.points.push_back({0, -3, 0});
    ASSERT_EQ(path.points.size(), 8u);
    const auto checked = check_user_path(scene, path);
    EXPECT_EQ(checked.problem, "");
    EXPECT_TRUE(checked.path);
}

TEST(Snap, SaysWhyNot) {
    const Scene scene = mirror_room();
    const std::vector<Vec3> diffuse_middle{{0, 1, 0}, {0, -1, 0}, {0.3f, -1, 0}};
    EXPECT_NE(snap(scene, diffuse_middle, 1).problem, "");
    EXPECT_NE(snap(scene, diffuse_middle, 0).problem, "");
    EXPECT_NE(snap(scene, diffuse_middle, 7).problem, "");
    // The mirror sends nothing behind itself.
    const std::vector<Vec3> behind{{0, 1, 0}, {-1, 0, 0}, {-3, -1, 0}};
    EXPECT_NE(snap(scene, behind, 1).problem, "");
    EXPECT_EQ(snap(scene, behind, 1).points.size(), 3u);
}

TEST(TraceLight, FollowsMirrorsToTheFirstDiffuseSurface) {
    const Scene scene = mirror_room();
    const auto points = trace_light(scene, {0, 0.999f, 0}, normalize(Vec3{-1, -1, 0}), 8);
    ASSERT_EQ(points.size(), 2u);
    EXPECT_TRUE(points[0].is_specular);
    EXPECT_LT(length(points[0].p - Vec3{-1, -0.001f, 0}), 1e-4f);
    EXPECT_FALSE(points[1].is_specular);
    EXPECT_NEAR(points[1].p.y, -1, 1e-5f);
    EXPECT_EQ(trace_light(scene, {0, 0.999f, 0}, normalize(Vec3{-1, -1, 0}), 1).size(), 1u);
    EXPECT_TRUE(trace_light(scene, {0, 9, 0}, {0, 1, 0}, 8).empty());
}

TEST(DrawnShapes, KeepTheirBoundsAndTheirLimit) {
    const Scene scene = build(sensor("0,0,3", "0,0,0", 8) + room() + area_lamp() +
                              sphere("0.3,0.2,0.1", "0.4", diffuse("0.5,0.5,0.5")));
    const std::vector<DrawnShape> all = drawn_shapes(scene, 1'000'000);
    ASSERT_EQ(all.size(), scene.shapes().size());
    for (const DrawnShape& s : all) {
        const Bounds3 b = scene.shapes()[s.shape].shape->bounds();
        EXPECT_LT(length(s.bounds.lo - b.lo) + length(s.bounds.hi - b.hi), 2e-2f);
        for (const uint32_t i : s.triangles) EXPECT_LT(i, s.positions.size() / 3);
    }
    EXPECT_EQ(std::count_if(all.begin(), all.end(), [](const auto& s) { return s.emits; }), 1);
    for (const DrawnShape& s : all) EXPECT_EQ(s.places.size(), 1u);
    size_t triangles = 0;
    for (const DrawnShape& s : drawn_shapes(scene, 500)) triangles += s.triangles.size() / 3;
    EXPECT_LE(triangles, 500u);
}

/// A wavy surface of 2 · edge² triangles in an OBJ file, which is gone when the scene is built.
Scene wavy_scene(int edge) {
    const std::string file = ::testing::TempDir() + "/etendue-wavy.obj";
    {
        std::ofstream obj(file);
        for (int row = 0; row <= edge; ++row)
            for (int column = 0; column <= edge; ++column) {
                const float x = 2 * float(column) / float(edge) - 1,
                            z = 2 * float(row) / float(edge) - 1;
                obj << "v " << x << " " << 0.2f * std::sin(7 * x) * std::cos(5 * z) << " " << z
                    << "\n";
            }
        for (int row = 0; row < edge; ++row)
            for (int column = 0; column < edge; ++column) {
                const int a = row * (edge + 1) + column + 1, b = a + edge + 1;
                obj << "f " << a << " " << b << " " << b + 1 << "\nf " << a << " " << b + 1 << " "
                    << a + 1 << "\n";
            }
    }
    Scene scene =
        build(sensor("0,0,3", "0,0,0", 8) + area_lamp() +
              "<shape type=\"obj\"><string name=\"filename\" value=\"" + file + "\"/></shape>");
    std::filesystem::remove(file);
    return scene;
}

TEST(DrawnShapes, HaveFewerTrianglesInMotion) {
    constexpr int kEdge = 200;
    const Scene wavy = wavy_scene(kEdge);
    const auto drawn = drawn_shapes(wavy, 160'000);
    const DrawnShape& mesh = *std::max_element(drawn.begin(), drawn.end(), [](auto& a, auto& b) {
        return a.triangles.size() < b.triangles.size();
    });
    EXPECT_EQ(mesh.triangles.size(), size_t(6 * kEdge * kEdge));
    EXPECT_LE(mesh.coarse_triangles.size(), 3u * 10'000);
    EXPECT_GE(mesh.coarse_triangles.size(), 3u * 1'000);
    Bounds3 coarse;
    for (const uint32_t i : mesh.coarse_triangles) {
        ASSERT_LT(i, mesh.positions.size() / 3);
        const uint16_t* p = &mesh.positions[3 * size_t(i)];
        coarse.extend(Vec3{float(p[0]), float(p[1]), float(p[2])} * (1 / 65535.0f));
    }
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_LT(coarse.lo[axis], 0.1f);
        EXPECT_GT(coarse.hi[axis], 0.9f);
    }
    const auto simplified = drawn_shapes(wavy, 20'000);
    size_t triangles = 0;
    for (const DrawnShape& s : simplified) {
        triangles += s.triangles.size() / 3;
        for (const uint32_t i : s.triangles) ASSERT_LT(i, s.positions.size() / 3);
        for (const uint32_t i : s.coarse_triangles) ASSERT_LT(i, s.positions.size() / 3);
    }
    EXPECT_LE(triangles, 20'000u);
    // Others have too few triangles for a coarse level.
    for (const DrawnShape& s : drawn) EXPECT_TRUE(&s == &mesh || s.coarse_triangles.empty());
}

/// Many small shapes keep the limit together; the large ones stay.
TEST(DrawnShapes, OfManySmallShapesKeepTheLimit) {
    std::string spheres, cubes;
    constexpr int kCount = 60;
    for (int i = 0; i < kCount; ++i) {
        const std::string x = std::to_string(0.03 * i - 0.9), r = std::to_string(0.01 + 1e-4 * i);
        spheres += sphere(x + ",0,0", r, "");
        cubes += "<shape type=\"cube\"><transform name=\"to_world\"><scale value=\"" + r +
                 "\"/><translate x=\"" + x + "\"/></transform></shape>";
    }
    const auto triangles_of = [](const std::vector<DrawnShape>& drawn) {
        size_t triangles = 0;
        for (const DrawnShape& s : drawn) triangles += s.triangles.size() / 3;
        return triangles;
    };
    for (const std::string& small : {spheres, cubes})
        for (const size_t most : {20'000u, 3'000u, 200u}) {
            const Scene scene = build(sensor("0,0,3", "0,0,0", 8) + room() + area_lamp() + small);
            const auto drawn = drawn_shapes(scene, most);
            EXPECT_LE(triangles_of(drawn), most);
            EXPECT_GT(triangles_of(drawn), std::min<size_t>(most, 700) / 10);
            // The walls, the lamp, and as many of the others as can be.
            EXPECT_GE(drawn.size(), std::min(size_t(66), 6 + most / 70));
            for (uint32_t i = 0; i < 6; ++i) EXPECT_EQ(drawn[i].shape, i);
            for (const DrawnShape& s : drawn)
                for (const uint32_t i : s.triangles) ASSERT_LT(i, s.positions.size() / 3);
        }
}

/// A sphere about the origin, placed three times, one of them larger: each place has what rays hit there.
TEST(DrawnShapes, AreDrawnOnceForEachInstance) {
    const auto instance = [](const std::string& transform) {
        return "<shape type=\"instance\"><ref id=\"group\"/><transform name=\"to_world\">" +
               transform + "</transform></shape>";
    };
    const Scene scene = build(
        sensor("0,0,9", "0,0,0", 8) + area_lamp() + "<shape type=\"shapegroup\" id=\"group\">" +
        sphere("0,0,0", "0.4", diffuse("0.5,0.5,0.5")) + "</shape>" +
        instance("<translate x=\"-2\"/>") + instance("<translate x=\"2\"/>") +
        instance("<rotate z=\"1\" angle=\"90\"/><scale value=\"2\"/><translate y=\"-3\"/>"));
    const std::vector<DrawnShape> all = drawn_shapes(scene, 1'000'000);
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(all[0].places.size(), 1u);
    const DrawnShape& ball = all[1];
    ASSERT_EQ(ball.places.size(), 3u);
    const auto in_world = [&](const DrawnShape::Place& m, size_t vertex) {
        Vec3 p, q;
        for (int axis = 0; axis < 3; ++axis)
            p[axis] = ball.bounds.lo[axis] + (ball.bounds.hi[axis] - ball.bounds.lo[axis]) *
                                                 float(ball.positions[3 * vertex + size_t(axis)]) /
                                                 65535;
        for (int row = 0; row < 3; ++row)
            q[row] = m[size_t(4 * row)] * p.x + m[size_t(4 * row + 1)] * p.y +
                     m[size_t(4 * row + 2)] * p.z + m[size_t(4 * row + 3)];
        return q;
    };
    const Vec3 centers[] = {{-2, 0, 0}, {2, 0, 0}, {0, -3, 0}};
    for (size_t i = 0; i < 3; ++i)
        for (size_t vertex = 0; vertex < ball.positions.size() / 3; vertex += 97) {
            const Vec3 p = in_world(ball.places[i], vertex);
            EXPECT_NEAR(length(p - centers[i]), i == 2 ? 0.8f : 0.4f, 1e-3f);
            Ray ray;
            ray.o = centers[i] + (p - centers[i]) * 2.0f;
            ray.d = normalize(centers[i] - p);
            SurfaceHit hit;
            ASSERT_TRUE(scene.intersect(ray, 0.5f, hit));
            EXPECT_LT(length(hit.geometry.p - p), 2e-3f);
        }
}

}  // namespace
}  // namespace etendue::test
