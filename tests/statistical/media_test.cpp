// Emitters and sensors inside absorbing media: all methods know in which medium a path starts.

#include <fmt/format.h>

#include "lit_room.h"
#include "render_tiles.h"

namespace etendue::test {
namespace {

const std::string kInk = "<medium type=\"homogeneous\" id=\"ink\"><rgb name=\"sigma_t\" "
                         "value=\"0.5,1,2\"/><rgb name=\"albedo\" value=\"0\"/></medium>";
const std::string kBall = "<shape type=\"sphere\"><bsdf type=\"null\"/><ref name=\"interior\" "
                          "id=\"ink\"/></shape>";
/// A value of an emitter, by colour.
std::string rgb(const char* name, Rgb v) {
    return fmt::format("<rgb name=\"{}\" value=\"{:.9g},{:.9g},{:.9g}\"/>", name, v.r, v.g, v.b);
}
std::string bulb(Rgb intensity, const char* position = "0,0,0") {
    return fmt::format(
        "<emitter type=\"point\"><point name=\"position\" value=\"{}\"/>{}</emitter>", position,
        rgb("intensity", intensity));
}

/// A wall lit from the origin, seen from outside of the ball.
std::string view_of_wall(const std::string& origin = "0,0,-1.3") {
    return sensor(origin, "0,0,-3", 4, "20") + kInk +
           rectangle("<scale value=\"2\"/><translate z=\"-3\"/>", diffuse("0.5"));
}

/// Attenuation by `distance` in the ink.
Rgb through_ink(float distance) {
    return exp(Rgb(0.5f, 1, 2) * -distance);
}

class MediaOfEnds : public ::testing::TestWithParam<std::string> {
protected:
    /// Few light paths reach the small image.
    static uint64_t passes() { return GetParam() == "light" ? 1 << 15 : 2048; }
    static Tiles tiles(const Scene& scene, uint64_t seed) {
        TileOptions options{.passes = passes(), .tiles = 2, .seed = seed};
        const std::string& method = GetParam();
        // Each pass has chains of its own, so that passes are independent.
        if (method.ends_with("mlt")) {
            options.passes = 512;
            return render_tiles(scene, fmt::format("{}:chains=16,groups=512", method), options);
        }
        if (!method.starts_with("ppm")) return render_tiles(scene, method, options);
        // The passes of `ppm` have the same eye paths, so that only other seeds show its spread.
        Tiles of_seeds(2);
        options.passes = 64;
        for (uint64_t i = 0; i < 64; ++i) {
            options.seed = 100 * seed + i;
            const Tiles one = render_tiles(scene, method, options);
            for (size_t k = 0; k < one.values.size(); ++k)
                of_seeds.values[k].add(one.values[k].mean());
        }
        return of_seeds;
    }
    /// The same image of a scene with ink, and of one without it and with a darker emitter.
    void expect_same(const std::string& ink, const std::string& clear,
                     double resolution = 0.2) const {
        const Tiles absorbed = tiles(build(ink), 1);
        EXPECT_GT(absorbed.values.back().mean(), 0);
        expect_same_image(absorbed, tiles(build(clear), 5), resolution, GetParam());
    }
};

TEST_P(MediaOfEnds, PointInABall) {
    expect_same(view_of_wall() + kBall + bulb(Rgb(20)), view_of_wall() + bulb(through_ink(1) * 20));
}

// A wall in the shadow of a disc, and a floor that lights it: all light comes along light paths, photons, or connections to
// them. No path meets the ball twice.
TEST_P(MediaOfEnds, PointInABallThatLightsAFloor) {
    const std::string corner =
        view_of_wall() +
        rectangle("<scale value=\"2,0.75,1\"/><rotate x=\"1\" angle=\"-90\"/>"
                  "<translate value=\"0,-2,-2.25\"/>",
                  diffuse("0.9")) +
        "<shape type=\"disk\"><transform name=\"to_world\"><scale value=\"0.8\"/><translate "
        "z=\"-1.1\"/></transform>" +
        diffuse("0") + "</shape>";
    // Few splats reach the wall. Light paths that start outside of the ink are up to seven times as bright.
    expect_same(corner + kBall + bulb(Rgb(20)), corner + bulb(through_ink(1) * 20),
                GetParam() == "light" ? 1 : 0.3);
}

/// Means of what passes from a lamp of this radius in the middle of the ball to a distant wall. A point of the lamp, at the angle
/// whose cosine is c as seen from the centre, is nearer to the wall by c radii, and beside the axis, where the ball is thinner.
/// The wall sees points of all c with the density 2c.
Rgb from_lamp_in_ball(float radius) {
    constexpr int kSteps = 1000;
    Rgb sum;
    for (int i = 0; i < kSteps; ++i) {
        const float c = (float(i) + 0.5f) / kSteps;
        sum += through_ink(1 - radius * c - sqr(radius) * (1 - c * c) / 2) * (2 * c / kSteps);
    }
    return sum;
}

TEST_P(MediaOfEnds, LampInABall) {
    const auto lamp = [](Rgb factor) {
        return sphere("0,0,0", "0.02",
                      diffuse("0") + "<emitter type=\"area\">" + rgb("radiance", factor * 20000) +
                          "</emitter>");
    };
    expect_same(view_of_wall() + kBall + lamp(Rgb(1)),
                view_of_wall() + lamp(from_lamp_in_ball(0.02f)));
}

TEST_P(MediaOfEnds, SensorInABall) {
    const char* const position = "0,0,-1.5";
    const std::string view = sensor("0,0,0", "0,0,-3", 4, "40") + kInk +
                             rectangle("<scale value=\"2\"/><translate z=\"-3\"/>", diffuse("0.5"));
    expect_same(view + kBall + bulb(Rgb(1), position), view + bulb(through_ink(1), position));
}

// Half of the lamp is inside of the ball.
TEST_P(MediaOfEnds, LampAcrossTheSurface) {
    const auto scene = [](const std::string& ball) {
        return build(sensor("0,0,1.5", "0,0,-3", 4, "60") + kInk + ball +
                     rectangle("<scale value=\"2\"/><translate z=\"-3\"/>", diffuse("0.5")) +
                     rectangle("<scale value=\"0.5\"/><rotate y=\"1\" angle=\"130\"/><translate "
                               "value=\"0.6,0,-0.6\"/>",
                               diffuse("0") + "<emitter type=\"area\"/>"));
    };
    const Scene half = scene(kBall);
    ASSERT_EQ(half.emitter(0).medium, kSeveralMedia);
    if (GetParam().starts_with("ppm"))
        GTEST_SKIP() << "its density estimate is wide at the foot of the wall";
    expect_same_image(tiles(half, 1),
                      render_tiles(half, "path", {.passes = 4096, .tiles = 2, .seed = 5}), 0.2,
                      GetParam());
}

INSTANTIATE_TEST_SUITE_P(All, MediaOfEnds,
                         ::testing::Values("path", "light", "bdpt", "pcbpt", "vcm", "upg+bdpt",
                                           "sppm:light_paths=700,radius=0.5", "pssmlt", "mmlt",
                                           "mlt"),
                         name_of_integrator);
INSTANTIATE_TEST_SUITE_P(Long, MediaOfEnds,
                         ::testing::Values("ppm:light_paths=1000,radius=0.5", "pm", "mps",
                                           "mps:target=path", "upg+pssmlt"),
                         name_of_integrator);

}  // namespace
}  // namespace etendue::test
