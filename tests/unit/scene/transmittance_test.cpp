// Shadow rays at the limits of single precision.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "math/frame.h"
#include "random.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

const std::string kSky = "<emitter type=\"constant\"/>";

std::string wall(float z) {
    return rectangle(fmt::format("<scale value=\"10\"/><translate z=\"{}\"/>", z), "");
}

// A wall 1 mm before another, seen from a kilometre away.
TEST(Transmittance, AWallHidesWhatLiesCloseBehindIt) {
    const Scene scene = build(front_camera(1) + kSky + wall(0) + wall(0.001f));
    const Vec3 far{0.3f, 0.2f, 1000}, behind{1.2f, -0.7f, 0}, before{1.2f, -0.7f, 0.001f};
    const Vec3 n{0, 0, 1};
    EXPECT_EQ(scene.transmittance(far, -n, behind, n), 0);
    EXPECT_EQ(scene.transmittance(behind, n, far, -n), 0);
    EXPECT_EQ(scene.transmittance(far, -n, before, n), 1);
    EXPECT_EQ(scene.transmittance(before, n, far, -n), 1);
}

// No point of a surface is hidden by its own surface, from near or far, head on or grazing.
TEST(Transmittance, ASurfaceDoesNotHideItself) {
    etendue::testing::Random random(7);
    for (const float distance : {0.1f, 1.0f, 100.0f, 1e4f})
        for (const float size : {1.0f, 50.0f}) {
            int hidden = 0, total = 0;
            for (int turn = 0; turn < 20; ++turn) {
                const Scene scene = build(
                    front_camera(1) + kSky +
                    rectangle(fmt::format("<scale value=\"{}\"/><rotate x=\"1\" y=\"0.3\" "
                                          "angle=\"{}\"/><translate x=\"1\" y=\"-2\" z=\"3\"/>",
                                          size, 3 + 17 * turn),
                              ""));
                const uint32_t shape = uint32_t(scene.shapes().size() - 1);
                for (int i = 0; i < 1000; ++i) {
                    const SurfaceLocation at{shape, uint32_t(random.bits() & 1), kNoInstance,
                                             0.5f * random.next_1d(), 0.5f * random.next_1d()};
                    const SurfaceGeometry g = scene.surface(at);
                    // cos θ down to 0.01
                    const float cosine = std::pow(10.0f, -2 * random.next_1d()),
                                phi = 2 * kPi * random.next_1d(), sine = safe_sqrt(1 - sqr(cosine));
                    const Vec3 w = Frame::from_normal(g.ng).to_world(
                        {sine * std::cos(phi), sine * std::sin(phi), cosine});
                    const Vec3 from = g.p + w * distance;
                    hidden += scene.transmittance(from, {}, g.p, g.ng) == 0;
                    hidden += scene.transmittance(g.p, g.ng, from, {}) == 0;
                    total += 2;
                }
            }
            EXPECT_EQ(hidden, 0) << "of " << total << " at " << distance << ", size " << size;
        }
}

}  // namespace
}  // namespace etendue::test
