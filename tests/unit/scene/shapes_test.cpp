// Shapes in scene files.

#include <cmath>

#include <gtest/gtest.h>

#include "test_scenes.h"

namespace etendue::test {
namespace {

/// (u, v) where the ray meets the scene.
Vec2 uv_at(const Scene& scene, Vec3 from, Vec3 direction) {
    SurfaceHit hit;
    EXPECT_TRUE(scene.intersect(Ray{from, direction}, 0.5f, hit));
    return hit.geometry.uv;
}

// The axis (1, 0, 0) has the tangents (0, 0, -1) and (0, 1, 0) [Duff et al. 2017], as in Mitsuba 3.
TEST(Cylinder, BetweenTwoPointsStartsItsAngleAtTheFirstTangentOfTheAxis) {
    const Scene scene =
        build(sensor("0,0,9", "0,0,0", 4) +
              "<shape type=\"cylinder\"><point name=\"p0\" value=\"1,0,0\"/><point name=\"p1\" "
              "value=\"5,0,0\"/>"
              "<float name=\"radius\" value=\"0.5\"/></shape><emitter type=\"constant\"/>");
    const float a = std::sqrt(0.5f);
    const Vec2 first = uv_at(scene, {2, 5 * a, -5 * a}, {0, -a, a});  // between the tangents
    EXPECT_NEAR(first.x, 0.125f, 1e-5f);
    EXPECT_NEAR(first.y, 0.25f, 1e-5f);
    const Vec2 second = uv_at(scene, {4, 0, 5}, {0, 0, -1});
    EXPECT_NEAR(second.x, 0.5f, 1e-5f);
    EXPECT_NEAR(second.y, 0.75f, 1e-5f);
}

}  // namespace
}  // namespace etendue::test
