#include "math/transform.h"

#include <gtest/gtest.h>

#include "math/bounds.h"
#include "random.h"

namespace etendue {
namespace {

using testing::Random;

void expect_near(Vec3 a, Vec3 b, float tolerance) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

/// Translation, rotation and uneven, possibly mirroring scale.
Transform random_affine(Random& random) {
    const Vec3 t = random.in_cube() * 10, axis = random.unit_vector(), s = random.in_cube();
    const auto away_from_zero = [](float v) { return v < 0 ? v - 0.1f : v + 0.1f; };
    return Transform::translate(t) * Transform::rotate(axis, random.between(-360, 360)) *
           Transform::scale({away_from_zero(s.x), away_from_zero(s.y), away_from_zero(s.z)});
}

TEST(Transform, InverseUndoes) {
    Random random(1);
    for (int i = 0; i < 1000; ++i) {
        const Transform t = random_affine(random), inverse = t.inverse();
        const Vec3 v = random.in_cube() * 5;
        EXPECT_TRUE(t.is_invertible());
        expect_near(inverse.point(t.point(v)), v, 2e-5f);
        expect_near(t.point(inverse.point(v)), v, 2e-5f);
        expect_near(inverse.vector(t.vector(v)), v, 2e-5f);
        expect_near(inverse.normal(t.normal(v)), v, 2e-5f);
        EXPECT_NEAR(t.determinant3() * inverse.determinant3(), 1, 1e-9);
    }
}

TEST(Transform, ProductAppliesTheRightOneFirst) {
    Random random(2);
    for (int i = 0; i < 100; ++i) {
        const Transform a = random_affine(random), b = random_affine(random);
        const Vec3 v = random.in_cube();
        expect_near((a * b).point(v), a.point(b.point(v)), 1e-4f);
        expect_near((a * b).vector(v), a.vector(b.vector(v)), 1e-4f);
    }
    expect_near((Transform::translate({1, 0, 0}) * Transform::scale({2, 2, 2})).point({1, 1, 1}),
                {3, 2, 2}, 0);
}

TEST(Transform, NormalsStayPerpendicularToTangents) {
    Random random(3);
    for (int i = 0; i < 1000; ++i) {
        const Transform t = random_affine(random);
        const Vec3 n = random.unit_vector();
        const Vec3 tangent = cross(n, random.unit_vector());
        const Vec3 tn = t.normal(n), tt = t.vector(tangent);
        EXPECT_NEAR(dot(tn, tt), 0, 1e-5f * length(tn) * length(tt) + 1e-6f);
        EXPECT_GT(dot(t.vector(n), tn), 0);
    }
}

TEST(Transform, RotationIsCounterClockwise) {
    expect_near(Transform::rotate({0, 0, 1}, 90).vector({1, 0, 0}), {0, 1, 0}, 1e-6f);
    expect_near(Transform::rotate({5, 0, 0}, 90).vector({0, 1, 0}), {0, 0, 1}, 1e-6f);
    expect_near(Transform::rotate({0, 1, 0}, 90).vector({0, 0, 1}), {1, 0, 0}, 1e-6f);
    EXPECT_NEAR(Transform::rotate({1, 2, 3}, 77).determinant3(), 1, 1e-12);
}

TEST(Transform, LookAtLooksAlongZ) {
    const Vec3 origin{1, 2, 3}, target{4, -2, 3}, up{0, 0, 1};
    const auto t = Transform::look_at(origin, target, up);
    ASSERT_TRUE(t);
    expect_near(t->point({0, 0, 0}), origin, 1e-6f);
    expect_near(t->vector({0, 0, 1}), normalize(target - origin), 1e-6f);
    expect_near(t->vector({0, 1, 0}), up, 1e-6f);
    EXPECT_NEAR(t->determinant3(), 1, 1e-6);
    EXPECT_FALSE(Transform::look_at(origin, origin, up));
    EXPECT_FALSE(Transform::look_at(origin, origin + up * -3, up));
}

TEST(Transform, ProjectionsDivideByW) {
    const Transform t(Transform::Matrix{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 1, 0}}});
    expect_near(t.point({2, 4, 2}), {1, 2, 1}, 1e-6f);
    EXPECT_FALSE(t.is_invertible());
}

TEST(Transform, SingularMatricesAreRecognised) {
    EXPECT_FALSE(Transform::scale({1, 0, 1}).is_invertible());
    EXPECT_FALSE(Transform::scale({1, std::nanf(""), 1}).is_invertible());
    EXPECT_TRUE(Transform::scale({1e-15f, 1e15f, 1}).is_invertible());
    // Zeros on the diagonal need pivoting.
    EXPECT_TRUE(
        Transform(Transform::Matrix{{{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, 0, 1}, {0, 0, 1, 0}}})
            .is_invertible());
}

TEST(Transform, IdentityAndEquality) {
    EXPECT_TRUE(Transform().is_identity());
    EXPECT_TRUE(Transform::translate({0, 0, 0}).is_identity());
    EXPECT_FALSE(Transform::translate({0, 1e-6f, 0}).is_identity());
    EXPECT_EQ(Transform::scale({2, 2, 2}), Transform::scale({2, 2, 2}));
    EXPECT_LT(Transform::scale({-1, 1, 1}).determinant3(), 0);
}

TEST(Bounds, GrowAndMeasure) {
    Bounds3 b;
    EXPECT_TRUE(b.is_empty());
    EXPECT_EQ(b.radius(), 0);
    b.extend(Vec3{1, 2, 3});
    EXPECT_FALSE(b.is_empty());
    EXPECT_EQ(b.center(), (Vec3{1, 2, 3}));
    Bounds3 other;
    other.extend(Vec3{-1, 2, 3});
    other.extend(Vec3{1, 2, 7});
    b.extend(other);
    EXPECT_EQ(b.lo, (Vec3{-1, 2, 3}));
    EXPECT_EQ(b.hi, (Vec3{1, 2, 7}));
    EXPECT_NEAR(b.radius(), std::sqrt(5.0f), 1e-6f);
    b.extend(Bounds3{});
    EXPECT_EQ(b.hi, (Vec3{1, 2, 7}));
}

}  // namespace
}  // namespace etendue
