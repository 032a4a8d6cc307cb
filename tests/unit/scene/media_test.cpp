// In which medium emitters and sensors lie.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "test_scenes.h"

namespace etendue::test {
namespace {

const std::string kInk = "<medium type=\"homogeneous\" id=\"ink\"><rgb name=\"sigma_t\" "
                         "value=\"1\"/><rgb name=\"albedo\" value=\"0\"/></medium>";

/// A ball of ink of radius 1 about the origin, of a material.
std::string ball(const std::string& bsdf = "<bsdf type=\"null\"/>") {
    return "<shape type=\"sphere\">" + bsdf + "<ref name=\"interior\" id=\"ink\"/></shape>";
}
std::string bulb(const std::string& position) {
    return "<emitter type=\"point\"><point name=\"position\" value=\"" + position +
           "\"/></emitter>";
}
std::string lamp(const std::string& center, const std::string& radius,
                 const std::string& more = "") {
    return sphere(center, radius, "<emitter type=\"area\"/>" + more);
}
Scene with(const std::string& body, const std::string& camera = "0,0,5") {
    return build(sensor(camera, "0,0,0.1", 4) + kInk + body);
}
/// The medium of light that leaves the first emitter at the point with the given first number.
MediumId start(const Scene& scene, double u = 0.5) {
    const Emitter& e = scene.emitter(0);
    const EmissionSample s = e.sample_emission({u, 0.5}, {0.5f, 0.5f});
    return scene.medium_at(e, e.is_area() ? RayEnd{s.p, s.ng, e.slack(s.prim)} : RayEnd{s.p});
}

TEST(MediumOfEmitters, IsThatOfTheBoundariesAround) {
    EXPECT_EQ(start(with(ball() + bulb("0.2,0.3,0"))), 0);
    EXPECT_EQ(start(with(ball() + bulb("0,0,3"))), kVacuum);
    EXPECT_EQ(start(with(ball() + lamp("0.2,0.3,0", "0.1"))), 0);
    EXPECT_EQ(start(with(ball() + lamp("0,0,3", "0.1"))), kVacuum);
    EXPECT_EQ(start(with(ball(kGlass) + bulb("0.2,0.3,0"))), 0);
    // A hole, in which there is no ink.
    const std::string hole = "<shape type=\"sphere\"><float name=\"radius\" value=\"0.5\"/><bsdf "
                             "type=\"null\"/><ref name=\"exterior\" id=\"ink\"/></shape>";
    EXPECT_EQ(start(with(ball() + hole + bulb("0.2,0.1,0"))), kVacuum);
    EXPECT_EQ(start(with(ball() + hole + bulb("0.7,0.1,0"))), 0);
    // The lamp's own boundary says what is around it.
    EXPECT_EQ(start(with(lamp("0,0,0", "0.1", "<ref name=\"exterior\" id=\"ink\"/>"))), 0);
    EXPECT_EQ(start(with(ball() + lamp("0,0,0", "0.1", "<ref name=\"interior\" id=\"ink\"/>"))),
              kVacuum);
}

// In a shade or a glass without a medium, and under the open surface of a pond.
TEST(MediumOfEmitters, IsFoundBehindOtherSurfaces) {
    const std::string shade = sphere("0.2,0.3,0", "0.2", diffuse("0.5"));
    EXPECT_EQ(start(with(ball() + bulb("0.2,0.3,0") + shade)), 0);
    const std::string pond =
        "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"2\"/><rotate "
        "x=\"1\" "
        "angle=\"-90\"/></transform><bsdf type=\"dielectric\"/><ref name=\"interior\" "
        "id=\"ink\"/></shape>" +
        rectangle("<scale value=\"2\"/><rotate x=\"1\" angle=\"-90\"/><translate y=\"-1\"/>",
                  diffuse("0.5"));
    EXPECT_EQ(start(with(pond + bulb("0,-0.3,0"))), 0);
    EXPECT_EQ(start(with(pond + bulb("0,0.3,0"))), kVacuum);
}

TEST(MediumOfEmitters, DiffersBetweenPointsOfOneEmitter) {
    // The lamp's centre is on the surface of the ball.
    const Scene scene = with(ball() + lamp("1,0,0", "0.3"));
    EXPECT_EQ(scene.medium_around({{0.7f, 0, 0}, {-1, 0, 0}}), 0);
    EXPECT_EQ(scene.medium_around({{0.7f, 0, 0}}), 0);
    EXPECT_EQ(scene.emitter(0).medium, kSeveralMedia);
    EXPECT_EQ(scene.medium_at(scene.emitter(0), {{0.7f, 0, 0}, {-1, 0, 0}}), 0);
    EXPECT_EQ(scene.medium_at(scene.emitter(0), {{1.3f, 0, 0}, {1, 0, 0}}), kVacuum);
}

TEST(MediumOfEmitters, TwoSidedBoundary) {
    const Scene scene =
        with("<shape type=\"rectangle\"><ref name=\"interior\" id=\"ink\"/><emitter "
             "type=\"area\"><boolean name=\"two_sided\" value=\"true\"/></emitter></shape>");
    EXPECT_EQ(scene.emitter(0).medium, kVacuum);
    EXPECT_EQ(scene.emitter(0).medium_behind, 0);
}

TEST(MediumOfSensors, IsThatOfTheBoundariesAround) {
    EXPECT_EQ(with(ball() + bulb("0,0,3"), "0,0,0.6").sensor_medium(), 0);
    EXPECT_EQ(with(ball() + bulb("0,0,3"), "0,0,6").sensor_medium(), kVacuum);
    const auto camera_in = [](const std::string& medium) {
        return build(sensor("0,0,0.6", "0,0,-1", 4, "45", medium) + kInk + ball() + bulb("0,0,3"));
    };
    EXPECT_EQ(camera_in("<ref id=\"ink\"/>").sensor_medium(), 0);
    EXPECT_THROW(camera_in("<medium type=\"homogeneous\"><rgb name=\"sigma_t\" value=\"3\"/><rgb "
                           "name=\"albedo\" value=\"0\"/></medium>"),
                 SceneError);
}

}  // namespace
}  // namespace etendue::test
