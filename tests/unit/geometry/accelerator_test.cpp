#include "geometry/accelerator.h"

#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "geometry/ray_tracer.h"
#include "random.h"

namespace etendue {
namespace {

/// A closed mesh about the origin, with triangles of all shapes.
TriangleMesh closed_mesh(int rows, int columns, float radius) {
    TriangleMesh::Arrays mesh;
    testing::Random random(1);
    const auto add = [&](float theta, float phi) {
        const float r = radius * random.between(0.7f, 1.3f);
        mesh.positions.push_back({r * std::sin(theta) * std::cos(phi), r * std::cos(theta),
                                  r * std::sin(theta) * std::sin(phi)});
    };
    add(0, 0);
    for (int i = 1; i < rows; ++i)
        for (int j = 0; j < columns; ++j)
            add(kPi * float(i) / float(rows), 2 * kPi * float(j) / float(columns));
    add(kPi, 0);
    const auto at = [&](int i, int j) {
        return i == 0      ? 0u
               : i == rows ? uint32_t(mesh.positions.size() - 1)
                           : uint32_t(1 + (i - 1) * columns + j % columns);
    };
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j) {
            if (i > 0) mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
            if (i + 1 < rows)
                mesh.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
        }
    return TriangleMesh(std::move(mesh));
}

// No ray slips through between triangles that share an edge.
TEST(Accelerator, ClosedMeshesHaveNoGaps) {
    const TriangleMesh mesh = closed_mesh(60, 120, 1);
    Accelerator accelerator({.is_watertight = true});
    accelerator.add_shape({&mesh});
    accelerator.commit();
    testing::Random random(2);
    int missed = 0;
    RayHit hit;
    for (int i = 0; i < 300000; ++i) {
        const auto& t = mesh.faces()[random.bits() % mesh.faces().size()].vertices;
        const Vec3 a = mesh.vertices()[t[0]].p, b = mesh.vertices()[t[1]].p;
        const Vec3 o = random.in_cube() * 0.3f;
        const Ray ray{o, normalize(a + (b - a) * random.between(0.01f, 0.99f) - o), kInf};
        missed += !accelerator.intersect(ray, hit) || accelerator.obstacle(ray) != Obstacle::Opaque;
    }
    EXPECT_EQ(missed, 0);
}

TEST(Accelerator, TakesHierarchiesOfGroupsFromAnEarlierOne) {
    const TriangleMesh mesh = closed_mesh(60, 120, 1), other = closed_mesh(20, 30, 1);
    const auto add = [&](Accelerator& a, float x) {
        const uint32_t groups[] = {a.add_group({{&mesh}}), a.add_group({{&other}})};
        a.add_instance(groups[0], Transform::translate({x, 0, 0}));
        a.add_instance(groups[1], Transform::translate({-x, 0, 0}));
        a.commit();
    };
    const AcceleratorOptions options;
    auto earlier = std::make_unique<Accelerator>(options);
    add(*earlier, 2);
    Accelerator moved(options, *earlier), fresh(options);
    add(moved, 3), add(fresh, 3);
    EXPECT_NEAR(double(moved.memory_bytes()), double(fresh.memory_bytes()),
                0.2 * double(fresh.memory_bytes()));
    earlier.reset();
    testing::Random random(3);
    int hits = 0;
    for (int i = 0; i < 10000; ++i) {
        const Ray ray{random.in_cube() * 5.0f, normalize(random.in_cube()), kInf};
        RayHit a, b;
        const bool is_hit = moved.intersect(ray, a);
        ASSERT_EQ(is_hit, fresh.intersect(ray, b));
        if (!is_hit) continue;
        ++hits;
        EXPECT_EQ(a.t, b.t);
        EXPECT_EQ(a.prim, b.prim);
        EXPECT_EQ(a.shape, b.shape);
        EXPECT_EQ(a.instance, b.instance);
    }
    EXPECT_GT(hits, 300);
    const Accelerator copy = moved;
    EXPECT_EQ(copy.memory_bytes(), moved.memory_bytes());
}

TEST(Accelerator, TakesHierarchiesOfGroupsOnlyWithTheSameObstacles) {
    const TriangleMesh mesh = closed_mesh(6, 8, 1);
    const auto obstacle = [&](Accelerator& a, bool may_let_rays_pass) {
        a.add_instance(a.add_group({{&mesh, may_let_rays_pass}}), Transform::translate({2, 0, 0}));
        a.commit();
        return a.obstacle({{2, 0, 5}, {0, 0, -1}, kInf});
    };
    Accelerator opaque;
    EXPECT_EQ(obstacle(opaque, false), Obstacle::Opaque);
    Accelerator passable({}, opaque);
    EXPECT_EQ(obstacle(passable, true), Obstacle::Passable);
    Accelerator again({}, passable);
    EXPECT_EQ(obstacle(again, false), Obstacle::Opaque);
    EXPECT_EQ(again.obstacle({{2, 0, 5}, {0, 0, 1}, kInf}), Obstacle::None);
}

/// Images of different machines are the same to the bit only with the same instruction set, which checkpoints name.
TEST(RayTracer, NamesItsInstructionSet) {
    EXPECT_TRUE(ray_tracer().starts_with("Embree ")) << ray_tracer();
#if defined(__x86_64__)
    EXPECT_NE(ray_tracer().find(", isa="), std::string::npos) << ray_tracer();
#endif
}

}  // namespace
}  // namespace etendue
