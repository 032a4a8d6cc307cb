// Small scenes on shapes that are very large, whose points have to be exact near the scene.

#include <fmt/format.h>

#include "lit_room.h"
#include "render_tiles.h"

namespace etendue::test {
namespace {

std::string grey_sphere(Vec3 center, double radius, const std::string& more) {
    return fmt::format(
        "<shape type=\"sphere\"><point name=\"center\" value=\"{:.9g},{:.9g},{:.9g}\"/>"
        "<float name=\"radius\" value=\"{:.9g}\"/>{}</shape>",
        center.x, center.y, center.z, radius, more);
}

// A convex ground under a sky of radiance 1 reflects its albedo.
TEST(LargeShapes, GroundUnderASky) {
    for (const double radius : {1e3, 1e5}) {
        const Scene scene =
            build(sensor("0,2.4,7", "0,0,1", 8, "25") + "<emitter type=\"constant\"/>" +
                  grey_sphere({0, -float(radius), 0}, radius, diffuse("0.5,0.5,0.5")));
        const Tiles exact = exact_tiles(scene.film(), 4, [](float, float) { return Rgb(0.5f); });
        for (const char* integrator : {"path", "bdpt", "vcm", "mlt"})
            expect_same_image(render_tiles(scene, integrator, {.passes = 512}), exact, 0.03,
                              fmt::format("{}, radius {}", integrator, radius));
    }
}

/// A room 100 wide with a lamp and two balls. Its walls are spheres of radius 10⁵, or rectangles.
Scene box(bool of_spheres) {
    constexpr double kRadius = 1e5;
    constexpr float kHalf = 50;
    std::string xml = sensor("0,0,40", "0,-10,-20", 8, "70");
    const struct {
        Vec3 side;
        const char *color, *turn;
    } walls[] = {
        {{-1, 0, 0}, "0.75,0.25,0.25", "<rotate y=\"1\" angle=\"90\"/>"},
        {{1, 0, 0}, "0.25,0.25,0.75", "<rotate y=\"1\" angle=\"-90\"/>"},
        {{0, -1, 0}, "0.75,0.75,0.75", "<rotate x=\"1\" angle=\"-90\"/>"},
        {{0, 1, 0}, "0.75,0.75,0.75", "<rotate x=\"1\" angle=\"90\"/>"},
        {{0, 0, -1}, "0.75,0.75,0.75", ""},
        {{0, 0, 1}, "0.1,0.1,0.1", "<rotate y=\"1\" angle=\"180\"/>"},
    };
    for (const auto& w : walls)
        xml += of_spheres
                   ? grey_sphere(w.side * float(kHalf + kRadius), kRadius, diffuse(w.color))
                   : rectangle(fmt::format("<scale value=\"{}\"/>{}<translate value=\"{},{},{}\"/>",
                                           kHalf, w.turn, kHalf * w.side.x, kHalf * w.side.y,
                                           kHalf * w.side.z),
                               diffuse(w.color));
    xml += grey_sphere({0, 35, -10}, 6, "<emitter type=\"area\"/>") +
           grey_sphere({-20, -35, -20}, 15, diffuse("0.9,0.9,0.9")) +
           grey_sphere({20, -35, 0}, 15, kGlass);
    return build(xml);
}

class SphereBox : public ::testing::TestWithParam<std::string> {};

// Radii of merges are given, since the default ones are large in small images. Passes have to be independent: each pass of
// a Markov chain is a group, and mps traces new photons in each.
TEST_P(SphereBox, LooksLikeABoxOfRectangles) {
    const std::string method = GetParam().substr(0, GetParam().find(':'));
    const bool has_groups = GetParam().ends_with("groups=1024");
    const uint64_t passes = method == "mps"    ? 512
                            : has_groups       ? 1024
                            : method == "sppm" ? 16384
                            : method == "upg"  ? 4096
                                               : 2048;
    expect_same_image(
        render_tiles(box(true), GetParam(), {.passes = passes, .tiles = 2}),
        render_tiles(box(false), GetParam(), {.passes = passes, .tiles = 2, .seed = 2}), 0.1,
        method);
}

const auto kMethod = [](const ::testing::TestParamInfo<std::string>& p) {
    return p.param.substr(0, p.param.find(':'));
};
INSTANTIATE_TEST_SUITE_P(Quick, SphereBox, ::testing::Values("path", "light", "bdpt", "upg"),
                         kMethod);
INSTANTIATE_TEST_SUITE_P(
    Long, SphereBox,
    ::testing::Values("vcm:radius=1", "sppm:radius=3", "pcbpt", "pssmlt:chains=16,groups=1024",
                      "mmlt:chains=48,groups=1024", "mlt:chains=48,groups=1024",
                      "mps:mutations=2000,precision=0.2,radius=3,retrace=true"),
    kMethod);

}  // namespace
}  // namespace etendue::test
