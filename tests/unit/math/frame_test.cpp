#include "math/frame.h"

#include <gtest/gtest.h>

#include "random.h"

namespace etendue {
namespace {

using testing::Random;

void expect_right_handed_orthonormal(const Frame& f, float tolerance = 1e-5f) {
    EXPECT_NEAR(length(f.s), 1, tolerance);
    EXPECT_NEAR(length(f.t), 1, tolerance);
    EXPECT_NEAR(length(f.n), 1, tolerance);
    EXPECT_NEAR(dot(f.s, f.t), 0, tolerance);
    EXPECT_NEAR(dot(f.s, f.n), 0, tolerance);
    EXPECT_NEAR(dot(f.t, f.n), 0, tolerance);
    EXPECT_NEAR(length(cross(f.s, f.t) - f.n), 0, 2 * tolerance);
}

TEST(Frame, FromNormalIsOrthonormalEverywhere) {
    Random random(1);
    for (int i = 0; i < 10000; ++i)
        expect_right_handed_orthonormal(Frame::from_normal(random.unit_vector()));
    // Both poles, with both signs of zero, and next to them.
    for (const float z : {1.0f, -1.0f})
        for (const float x : {0.0f, -0.0f, 1e-4f, -1e-7f, 1e-20f})
            expect_right_handed_orthonormal(Frame::from_normal(normalize({x, x, z})));
    expect_right_handed_orthonormal(Frame::from_normal({1, 0, 0.0f}));
    expect_right_handed_orthonormal(Frame::from_normal({1, 0, -0.0f}));
}

TEST(Frame, FollowsTheTangent) {
    Random random(2);
    for (int i = 0; i < 10000; ++i) {
        const Vec3 n = random.unit_vector(), tangent = random.in_cube() * 100;
        const Frame f = Frame::from_normal_and_tangent(n, tangent);
        EXPECT_EQ(f.n, n);
        expect_right_handed_orthonormal(f, 1e-4f);
        EXPECT_GT(dot(f.s, tangent), 0);
        EXPECT_NEAR(dot(f.t, tangent), 0, 1e-4f * length(tangent));
    }
}

TEST(Frame, TangentsParallelToTheNormalGiveAValidFrame) {
    Random random(3);
    for (int i = 0; i < 1000; ++i) {
        const Vec3 n = random.unit_vector(), other = random.unit_vector();
        for (const Vec3 tangent : {Vec3{}, n, n * -3, n + other * 1e-7f, n + other * 1e-6f,
                                   n + other * 1e-5f, n * 1e-25f, other * 1e-15f})
            expect_right_handed_orthonormal(Frame::from_normal_and_tangent(n, tangent), 1e-4f);
    }
}

TEST(Frame, LocalAndWorldAreInverse) {
    Random random(4);
    for (int i = 0; i < 1000; ++i) {
        const Frame f = Frame::from_normal(random.unit_vector());
        const Vec3 v = random.in_cube();
        EXPECT_NEAR(length(f.to_world(f.to_local(v)) - v), 0, 1e-6f);
        EXPECT_NEAR(f.to_local(f.n).z, 1, 1e-6f);
    }
}

TEST(Frame, FlippedTurnsTheNormalAndStaysRightHanded) {
    const Frame f = Frame::from_normal(normalize({1, 2, 3}));
    expect_right_handed_orthonormal(f.flipped());
    EXPECT_EQ(f.flipped().n, -f.n);
    EXPECT_EQ(f.flipped().s, f.s);
}

TEST(LocalDirections, TrigonometryAgrees) {
    const float theta = 0.7f;
    const Vec3 w{std::sin(theta), 0, std::cos(theta)};
    EXPECT_NEAR(cos_theta(w), std::cos(theta), 1e-6f);
    EXPECT_NEAR(abs_cos_theta(-w), std::cos(theta), 1e-6f);
    EXPECT_NEAR(cos2_theta(w), sqr(std::cos(theta)), 1e-6f);
    EXPECT_NEAR(sin2_theta(w), sqr(std::sin(theta)), 1e-6f);
    EXPECT_NEAR(tan2_theta(w), sqr(std::tan(theta)), 1e-5f);
    EXPECT_EQ(sin2_theta({0, 0, 1.0000001f}), 0);
    EXPECT_TRUE(same_hemisphere({0, 0, -1}, {1, 0, -0.1f}));
    EXPECT_FALSE(same_hemisphere({0, 0, 1}, {1, 0, -0.1f}));
}

TEST(LocalDirections, ReflectionKeepsTheAngleAndThePlane) {
    Random random(5);
    for (int i = 0; i < 1000; ++i) {
        const Vec3 w = random.unit_vector(), m = random.unit_vector();
        const Vec3 r = reflect(w, m);
        EXPECT_NEAR(length(r), 1, 1e-5f);
        EXPECT_NEAR(dot(r, m), dot(w, m), 1e-5f);
        EXPECT_NEAR(dot(r, cross(w, m)), 0, 1e-5f);
        EXPECT_NEAR(length(reflect(r, m) - w), 0, 1e-5f);
        EXPECT_NEAR(length(reflect(w) - reflect(w, {0, 0, 1})), 0, 1e-6f);
    }
}

}  // namespace
}  // namespace etendue
