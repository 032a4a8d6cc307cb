// Differential geometry of shapes against differences of near points.

#include <array>
#include <memory>

#include <gtest/gtest.h>

#include "geometry/accelerator.h"
#include "random.h"

namespace etendue {
namespace {

struct NamedShape {
    const char* name;
    std::unique_ptr<Shape> shape;
    bool is_curved;
};

std::vector<NamedShape> shapes() {
    const Transform to_world = Transform::translate({1, -2, 3}) *
                               Transform::rotate({3, 1, -2}, 70) * Transform::scale({2, 2, 2});
    const std::vector<Vec3> points = {{0, 0, 1}, {2, 0.3f, 1.2f}, {0.4f, 1.7f, 0.8f}};
    std::vector<Vec3> normals;
    for (const Vec3 n : {Vec3{-0.2f, -0.1f, 1}, Vec3{0.4f, 0, 1}, Vec3{0.1f, 0.3f, 1}})
        normals.push_back(normalize(n));
    std::vector<NamedShape> list;
    list.push_back({"sphere", std::make_unique<Sphere>(to_world, true), true});
    list.push_back({"cylinder", std::make_unique<Cylinder>(to_world, true), true});
    list.push_back({"disk", std::make_unique<Disk>(to_world, true), false});
    list.push_back({"triangle",
                    std::make_unique<TriangleMesh>(
                        TriangleMesh::Arrays{.positions = points, .triangles = {{0, 1, 2}}}),
                    false});
    list.push_back({"smooth_triangle",
                    std::make_unique<TriangleMesh>(
                        TriangleMesh::Arrays{.positions = points,
                                             .normals = normals,
                                             .uvs = {{0.1f, 0.2f}, {1.3f, 0.4f}, {0, -0.8f}},
                                             .second_uvs = {{1, 0.2f}, {2, 4}, {0.5f, -1}},
                                             .triangles = {{0, 2, 1}}}),
                    true});
    return list;
}

/// The multiples of the tangents whose sum is `v`, which is nearly tangent.
std::pair<double, double> coordinates(const SurfaceJet& at, Vec3d v) {
    const Vec3d n = cross(at.dpdu, at.dpdv);
    return {dot(cross(v, at.dpdv), n) / dot(n, n), dot(cross(at.dpdu, v), n) / dot(n, n)};
}

std::array<Dual, 10> numbers(const TextureJet& t) {
    return {t.uv.x,   t.uv.y,   t.second_uv.x, t.second_uv.y, t.dpdu.x,
            t.dpdu.y, t.dpdu.z, t.dpdv.x,      t.dpdv.y,      t.dpdv.z};
}

TEST(SurfaceJet, DerivativesAreLimitsOfDifferences) {
    constexpr double kStep = 1e-5;
    testing::Random random(1);
    for (const auto& [name, shape, is_curved] : shapes()) {
        double greatest = 0;
        for (int i = 0; i < 200; ++i) {
            const Vec3d target(shape->sample(0, random.next_2d()).p),
                o = target + Vec3d(random.unit_vector()) * 3, d = normalize(target - o);
            const double near = length(target - o);
            const auto at = shape->jet(0, o, d, near);
            ASSERT_TRUE(at) << name;
            EXPECT_NEAR(length(at->ng), 1, 1e-7) << name;
            EXPECT_NEAR(length(at->ns), 1, 1e-7) << name;
            if (std::fabs(dot(d, at->ng)) < 0.2) continue;
            EXPECT_LT(length(at->p - target), 2e-6) << name;
            for (const Vec3d along : {at->dpdu, at->dpdv}) {
                const Vec3d step = along * (kStep / length(along));
                const auto plus = shape->jet(0, o + step, d, near),
                           minus = shape->jet(0, o - step, d, near);
                ASSERT_TRUE(plus && minus) << name;
                const auto [u, v] = coordinates(*at, plus->p - minus->p);
                const Vec3d expected = at->dpdu * u + at->dpdv * v,
                            normal = at->dnsdu * u + at->dnsdv * v;
                EXPECT_LT(length(plus->p - minus->p - expected), 1e-4 * kStep) << name;
                EXPECT_LT(length(plus->ns - minus->ns - normal), 1e-4 * kStep) << name;
                greatest = std::max(greatest, length(normal) / kStep);

                const auto here = numbers(shape->texture_jet(0, *at)),
                           after = numbers(shape->texture_jet(0, *plus)),
                           before = numbers(shape->texture_jet(0, *minus));
                for (size_t k = 0; k < here.size(); ++k) {
                    const double difference = after[k].value - before[k].value,
                                 size = 1 + std::hypot(here[k].by_1, here[k].by_2);
                    // Azimuths jump.
                    if (std::fabs(difference) > 0.5) continue;
                    EXPECT_NEAR(difference / kStep, (here[k].by_1 * u + here[k].by_2 * v) / kStep,
                                1e-5 * size * size * size)
                        << name << ' ' << k;
                }
            }
        }
        EXPECT_EQ(greatest > 0.1, is_curved) << name << ": " << greatest;
    }
}

// The jet is that of the point which a hit has.
TEST(SurfaceJet, IsThatOfTheHit) {
    testing::Random random(2);
    for (const auto& [name, shape, is_curved] : shapes()) {
        Accelerator accelerator;
        accelerator.add_shape({shape.get()});
        accelerator.commit();
        int hits = 0;
        for (int i = 0; i < 500; ++i) {
            const Vec3 target = shape->sample(0, random.next_2d()).p,
                       o = target + random.unit_vector() * 7;
            const Ray ray{o, normalize(target - o), kInf};
            RayHit hit;
            if (!accelerator.intersect(ray, hit)) continue;
            ++hits;
            const SurfaceGeometry g = shape->surface(hit.prim, hit.u, hit.v, true);
            const auto at = shape->jet(hit.prim, Vec3d(o), Vec3d(ray.d), double(hit.t));
            if (!at || abs_dot(ray.d, g.ng) < 0.05f) continue;
            EXPECT_LT(length(at->p - Vec3d(g.p)), 2e-5) << name;
            EXPECT_GT(dot(at->ng, Vec3d(g.ng)), 1 - 1e-6) << name;
            EXPECT_GT(dot(at->ns, Vec3d(g.ns)), 1 - 1e-6) << name;
            const auto numbers_at = numbers(shape->texture_jet(hit.prim, *at));
            const float expected[] = {g.uv.x,   g.uv.y,   g.second_uv.x, g.second_uv.y, g.dpdu.x,
                                      g.dpdu.y, g.dpdu.z, g.dpdv.x,      g.dpdv.y,      g.dpdv.z};
            for (size_t k = 0; k < numbers_at.size(); ++k)
                EXPECT_NEAR(numbers_at[k].value, expected[k], 1e-4) << name << ' ' << k;
        }
        EXPECT_GT(hits, 400) << name;
    }
}

}  // namespace
}  // namespace etendue
