#include <cmath>

#include <gtest/gtest.h>

#include "integrator/radius_params.h"
#include "integrator/seen_extent.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

float radius(const std::string& camera) {
    return default_merge_radius(build(camera + room() + area_lamp()));
}

/// The back wall fills most of the image; from z = 3.4 to -1 the image is 2·4.4·tan(22.5°) wide there.
TEST(DefaultMergeRadius, IsThatOfADiscOf36PixelsInLargeImages) {
    constexpr int kSize = 2048;
    const double pixel = 2 * 4.4 * std::tan(kPi / 8) / kSize;
    EXPECT_NEAR(radius(front_camera(kSize)), 6 * pixel / std::sqrt(kPi), 0.15 * 6 * pixel);
    EXPECT_NEAR(radius(front_camera(2 * kSize)) / radius(front_camera(kSize)), 0.5, 0.01);
}

TEST(DefaultMergeRadius, IsAtMostOnePercentOfTheScene) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    EXPECT_EQ(default_merge_radius(scene), 0.01f * scene.bounds().radius());
    // No eye ray hits a surface.
    EXPECT_NEAR(radius(sensor("0,0,3.4", "0,0,5", 2048)), 0.01f * scene.bounds().radius(), 1e-3);
}

// A window before the camera is looked through.
TEST(SeenExtent, IsThatBehindClearGlass) {
    const std::string
        window = rectangle("<scale value=\"0.06\"/><translate z=\"3.3\"/>",
                           "<bsdf type=\"thindielectric\"/>"),
        // Among them something behind the camera, so that the window does not extend the bounds.
        everything = room() + area_lamp() + rectangle("<translate z=\"5\"/>", "");
    for (const int size : {16, 2048}) {
        const Scene open = build(front_camera(size) + everything),
                    behind = build(front_camera(size) + everything + window);
        EXPECT_NEAR(seen_extent(behind).radius / seen_extent(open).radius, 1, 0.1);
        EXPECT_NEAR(default_merge_radius(behind) / default_merge_radius(open), 1, 0.1);
    }
    // Nothing is behind the window but the sky.
    const std::string sky = "<emitter type=\"constant\"/>",
                      distant = sphere("0,0,-1e6", "0.01", diffuse("0.5,0.5,0.5"));
    const float seen = seen_extent(build(front_camera(16) + window + sky + distant)).radius;
    EXPECT_GT(seen, 0.01f);
    EXPECT_LT(seen, 1);
}

}  // namespace
}  // namespace etendue::test
