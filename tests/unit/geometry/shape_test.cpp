#include "geometry/shape.h"

#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "geometry/accelerator.h"
#include "math/frame.h"
#include "random.h"

namespace etendue {
namespace {

constexpr double kUlp = 0x1p-24;  // half the distance of numbers between 1 and 2, relative to 1

/// Σ |n_i p_i| 2^-24: what rounding each coordinate of p once moves it along n, at most.
double rounding(const Vec3& p, const double n[3]) {
    return kUlp * (std::fabs(n[0] * p.x) + std::fabs(n[1] * p.y) + std::fabs(n[2] * p.z));
}

/// A radius and a centre so that the surface passes near the origin, as the ground of a scene does.
constexpr float kRadii[] = {0.3f, 40, 1e3f, 1e5f, 6.4e6f};

// However large the sphere is, its points are off by no more than the rounding of their coordinates.
TEST(Sphere, PointsLieOnTheSurface) {
    testing::Random random(1);
    for (const float radius : kRadii) {
        const Vec3 center = Vec3{0.36f, -0.8f, 0.48f} * radius;
        const Sphere sphere(center, radius, false);
        double worst = 0;
        for (int i = 0; i < 2000; ++i) {
            const Vec2 u = random.next_2d();
            const Vec3 p = i % 2 ? sphere.surface(0, u.x, u.y, false).p : sphere.sample(0, u).p;
            const double n[3] = {(double(p.x) - center.x) / radius,
                                 (double(p.y) - center.y) / radius,
                                 (double(p.z) - center.z) / radius};
            const double off =
                radius * std::fabs(std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) - 1);
            worst = std::max(worst, off / (rounding(p, n) + 1e-12 * radius));
        }
        EXPECT_LE(worst, 1.01) << "radius " << radius;
    }
}

TEST(Cylinder, PointsLieOnTheSurface) {
    testing::Random random(2);
    for (const float radius : kRadii) {
        const Transform to_world = Transform::translate({0, -radius, 0}) *
                                   Transform::scale({radius, radius, 2 * radius}) *
                                   Transform::translate({0, 0, -0.5f});
        const Cylinder cylinder(to_world, false);
        double worst = 0;
        for (int i = 0; i < 2000; ++i) {
            const Vec2 u = random.next_2d();
            const Vec3 p = i % 2 ? cylinder.surface(0, u.x, u.y, false).p : cylinder.sample(0, u).p;
            const double x = double(p.x) / radius, y = (double(p.y) + radius) / radius;
            const double n[3] = {x, y, 0}, off = radius * std::fabs(std::hypot(x, y) - 1);
            worst = std::max(worst, off / (rounding(p, n) + 1e-12 * radius));
        }
        EXPECT_LE(worst, 1.01) << "radius " << radius;
    }
}

TEST(TriangleMesh, PointsLieOnTheSurface) {
    testing::Random random(3);
    for (const float size : kRadii)
        for (int turn = 0; turn < 20; ++turn) {
            const Vec3 a = random.in_cube() * size, b = random.in_cube() * size,
                       c = random.in_cube() * size;
            const TriangleMesh mesh({.positions = {a, b, c}, .triangles = {{0, 1, 2}}});
            const double e[3] = {double(b.x) - a.x, double(b.y) - a.y, double(b.z) - a.z},
                         f[3] = {double(c.x) - a.x, double(c.y) - a.y, double(c.z) - a.z};
            double n[3] = {e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2],
                           e[0] * f[1] - e[1] * f[0]};
            const double size_n = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            for (double& x : n) x /= size_n;
            double worst = 0;
            for (int i = 0; i < 200; ++i) {
                const Vec3 p = mesh.sample(0, random.next_2d()).p;
                const double off =
                    std::fabs((double(p.x) - a.x) * n[0] + (double(p.y) - a.y) * n[1] +
                              (double(p.z) - a.z) * n[2]);
                worst = std::max(worst, off / (rounding(p, n) + 1e-12 * double(size)));
            }
            EXPECT_LE(worst, 1.01) << "size " << size;
        }
}

// Hits are found again from their parameters.
TEST(AnalyticShapes, ParametersOfHits) {
    testing::Random random(4);
    const Transform to_world = Transform::translate({1, -2, 3}) *
                               Transform::rotate({3, 1, -2}, 70) * Transform::scale({2, 2, 2});
    const std::unique_ptr<AnalyticShape> shapes[] = {std::make_unique<Sphere>(to_world, false),
                                                     std::make_unique<Disk>(to_world, false),
                                                     std::make_unique<Cylinder>(to_world, true)};
    for (const auto& shape : shapes)
        for (const bool in_group : {false, true}) {
            Accelerator accelerator;
            if (in_group)
                accelerator.add_instance(accelerator.add_group({{shape.get()}}),
                                         Transform::translate({0.5f, 0, 0}));
            else
                accelerator.add_shape({shape.get()});
            accelerator.commit();
            int hits = 0;
            for (int i = 0; i < 1000; ++i) {
                const Vec3 o{8 * random.next_1d() - 4, 8 * random.next_1d() - 6, 9};
                const Vec3 to = shape->sample(0, random.next_2d()).p;
                const Ray ray{o, normalize(to - o), kInf};
                RayHit hit;
                if (!accelerator.intersect(ray, hit)) continue;
                ++hits;
                EXPECT_EQ(accelerator.obstacle(ray), Obstacle::Opaque);
                Vec3 p = shape->surface(0, hit.u, hit.v, false).p;
                if (in_group) p.x += 0.5f;
                EXPECT_LT(length(p - (ray.o + ray.d * hit.t)), 2e-5f);
            }
            EXPECT_GT(hits, in_group ? 300 : 900);
        }
}

/// Expects that points of a shape through the origin are those that rays meet there.
void expect_hits_stay_in_place(const AnalyticShape& shape, Vec3 side) {
    testing::Random random(5);
    Accelerator accelerator;
    accelerator.add_shape({&shape});
    accelerator.commit();
    int hits = 0;
    for (int i = 0; i < 1000; ++i) {
        const Vec3 o = side * 50.0f + random.in_cube() * 30;
        const Ray ray{o, normalize(random.in_cube() * 40 - o), kInf};
        RayHit hit;
        if (!accelerator.intersect(ray, hit)) continue;
        ++hits;
        const Vec3 p = shape.surface(0, hit.u, hit.v, false).p;
        // Of the parameters, and of the ray's own distance.
        EXPECT_LT(length(p - (ray.o + ray.d * hit.t)), 2e-6f * (length(p) + hit.t));
    }
    EXPECT_GT(hits, 300);
}

// However large a shape is, and whatever side of it faces the origin.
TEST(AnalyticShapes, HitsOfLargeShapesStayInPlace) {
    const Vec3 sides[] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0},           {-1, 0, 0},
                          {0, 1, 0}, {0, -1, 0}, {0.48f, 0.6f, 0.64f}};
    for (const float size : {1e5f, 6.4e6f})
        for (const Vec3 side : sides) {
            expect_hits_stay_in_place(Sphere(side * size * -1.0f, size, false), side);
            const Frame frame = Frame::from_normal(side);
            // Discs that face the side, with the origin halfway to their rim.
            const Vec3 center = frame.s * (-0.5f * size);
            const Transform::Matrix disc = {{
                {frame.s.x * size, frame.t.x * size, side.x, center.x},
                {frame.s.y * size, frame.t.y * size, side.y, center.y},
                {frame.s.z * size, frame.t.z * size, side.z, center.z},
                {0, 0, 0, 1},
            }};
            expect_hits_stay_in_place(Disk(Transform(disc), false), side);
            // Cylinders along t, which end at the same distance on both sides.
            const Vec3 low = side * -size - frame.t * size;
            const Transform::Matrix cylinder = {{
                {side.x * size, frame.s.x * size, frame.t.x * 2 * size, low.x},
                {side.y * size, frame.s.y * size, frame.t.y * 2 * size, low.y},
                {side.z * size, frame.s.z * size, frame.t.z * 2 * size, low.z},
                {0, 0, 0, 1},
            }};
            expect_hits_stay_in_place(Cylinder(Transform(cylinder), false), side);
        }
}

TEST(Sphere, TextureCoordinatesAreAnglesAboutItsAxis) {
    testing::Random random(6);
    const Sphere sphere({30, -40, 5}, 50, false);
    for (int i = 0; i < 200; ++i) {
        const Vec2 u = random.next_2d();
        const SurfaceGeometry g = sphere.surface(0, u.x, u.y, true);
        const Vec3 n = (g.p - Vec3{30, -40, 5}) / 50.0f;
        const float phi = std::atan2(n.y, n.x) / (2 * kPi);
        EXPECT_NEAR(g.uv.x, phi < 0 ? phi + 1 : phi, 1e-4f);
        EXPECT_NEAR(g.uv.y, std::acos(clamp(n.z, -1, 1)) / kPi, 1e-4f);
        const float sine = std::hypot(n.x, n.y);
        EXPECT_LT(length(g.dpdu - Vec3{-n.y, n.x, 0} * (2 * kPi * 50)), 0.01f);
        EXPECT_LT(length(g.dpdv - Vec3{n.z * n.x / sine, n.z * n.y / sine, -sine} * (kPi * 50)),
                  0.02f);
        const ShapeSample s = sphere.sample(0, u);
        EXPECT_LT(length(sphere.surface(0, s.uv.x, s.uv.y, false).p - s.p), 1e-4f);
    }
}

// Edges whose products are beyond single precision, and whose areas are not.
TEST(TriangleMesh, HasNormalsInAnyUnits) {
    for (const float size : {1e-16f, 1e-12f, 1.0f, 1e10f, 1e17f}) {
        const TriangleMesh mesh({.positions = {{0, 0, 0}, {size, 0, 0}, {0, 2 * size, 0}},
                                 .triangles = {{0, 1, 1}, {0, 1, 2}}});
        ASSERT_EQ(mesh.faces().size(), 1u);
        EXPECT_EQ(mesh.faces()[0].ng.z, 1) << size;
        EXPECT_NEAR(mesh.area() / (double(size) * double(size)), 1, 1e-6);
    }
}

// The hierarchy may not take more memory than it is given, and says so.
TEST(Accelerator, MemoryIsBounded) {
    TriangleMesh::Arrays arrays;
    for (int i = 0; i < 300; ++i)
        for (int j = 0; j < 300; ++j)
            arrays.positions.push_back({float(i), float(j), float(i % 7)});
    for (uint32_t i = 0; i + 1 < 300; ++i)
        for (uint32_t j = 0; j + 1 < 300; ++j) {
            arrays.triangles.push_back({i * 300 + j, i * 300 + j + 1, i * 300 + j + 300});
            arrays.triangles.push_back({i * 300 + j + 1, i * 300 + j + 301, i * 300 + j + 300});
        }
    const TriangleMesh mesh(std::move(arrays));
    const auto make = [&](size_t most) {
        Accelerator accelerator({.most_bytes = most});
        accelerator.add_shape({&mesh});
        accelerator.commit();
        return accelerator.memory_bytes();
    };
    const size_t needed = make(memory_of_machine());
    EXPECT_GT(needed, size_t(1) << 20);
    for (const size_t most : {size_t(1) << 16, needed / 2}) {
        try {
            make(most);
            ADD_FAILURE() << "no error with " << most << " bytes";
        } catch (const std::runtime_error& e) {
            EXPECT_NE(std::string(e.what()).find("memory"), std::string::npos) << e.what();
        }
    }
}

}  // namespace
}  // namespace etendue
