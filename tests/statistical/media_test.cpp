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
    static uint64_t passes() { return GetParam() == "light" ? 1 << 15 : 1024; }
    /// The same image of a scene with ink, and of one without it and with a darker emitter.
    void expect_same(const std::string& ink, const std::string& clear) const {
        expect_same_image(
            render_tiles(build(ink), GetParam(), {.passes = passes(), .tiles = 2}),
            render_tiles(build(clear), GetParam(), {.passes = passes(), .tiles = 2, .seed = 5}),
            0.2, GetParam());
    }
};

TEST_P(MediaOfEnds, PointInABall) {
    expect_same(view_of_wall() + kBall + bulb(Rgb(20)), view_of_wall() + bulb(through_ink(1) * 20));
}

// The lamp is so small that all rays pass nearly the same distance in the ball.
TEST_P(MediaOfEnds, LampInABall) {
    const auto lamp = [](Rgb factor) {
        return sphere("0,0,0", "0.02",
                      diffuse("0") + "<emitter type=\"area\">" + rgb("radiance", factor * 20000) +
                          "</emitter>");
    };
    expect_same(view_of_wall() + kBall + lamp(Rgb(1)), view_of_wall() + lamp(through_ink(0.98f)));
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
    expect_same_image(render_tiles(half, GetParam(), {.passes = passes(), .tiles = 2}),
                      render_tiles(half, "path", {.passes = 4096, .tiles = 2, .seed = 5}), 0.2,
                      GetParam());
}

INSTANTIATE_TEST_SUITE_P(All, MediaOfEnds,
                         ::testing::Values("path", "light", "bdpt", "vcm", "upg+bdpt", "mlt"),
                         name_of_integrator);

}  // namespace
}  // namespace etendue::test
