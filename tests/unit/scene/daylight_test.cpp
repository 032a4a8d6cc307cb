// Daylight in scene files.

#include <gtest/gtest.h>

#include "random.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

Scene daylight(const std::string& type, const std::string& params,
               const std::string& version = "3.0.0") {
    return build_scene(parse_mitsuba_xml("<scene version=\"" + version + "\">" + front_camera(4) +
                                             room() + "<emitter type=\"" + type + "\">" + params +
                                             "</emitter></scene>",
                                         "test.xml"));
}

constexpr const char* kSunInZ = "<vector name=\"sun_direction\" x=\"0\" y=\"0.6\" z=\"0.8\"/>";

std::string float_element(const char* name, double value) {
    return "<float name=\"" + std::string(name) + "\" value=\"" + std::to_string(value) + "\"/>";
}

Rgb radiance(const Scene& scene, Vec3 d) {
    Rgb sum;
    for (const Emitter* e : scene.infinite_emitters()) sum += e->eval_infinite(d).Le;
    return sum;
}

// Every direction sampled by the sun has its density, which integrates to 1 over a disc of exactly its size.
TEST(Sun, HasTheDensityOfItsSamples) {
    for (const double aperture : {0.01, 0.5358, 20.0}) {
        const Scene scene =
            daylight("sun", std::string(kSunInZ) + float_element("sun_aperture", aperture) +
                                "<boolean name=\"complex_sun\" value=\"true\"/>");
        const Emitter& sun = *scene.emitters().front();
        const Vec3 axis = normalize(Vec3{0, 0.6f, 0.8f});
        const double radius = aperture / 2 * M_PI / 180,
                     solid_angle = 4 * M_PI * sqr(std::sin(radius / 2));
        etendue::testing::Random random(1);
        int outside = 0, inner_half = 0;
        constexpr int kSamples = 20000;
        for (int i = 0; i < kSamples; ++i) {
            DirectSample s;
            const Vec2 u = random.next_2d();
            ASSERT_TRUE(sun.sample_direct({}, FinePoint{double(u.x), double(u.y)}, s));
            EXPECT_NEAR(double(s.pdf) * solid_angle, 1, 1e-5);
            const EmitterHit hit = sun.eval_infinite(s.wi);
            outside += hit.pdf != s.pdf;
            const double angle = std::asin(double(length(cross(s.wi, axis))));
            inner_half += angle < radius * std::sqrt(0.5);
        }
        // By rounding at the rim: a direction has 24 bits.
        EXPECT_LT(outside, kSamples * (1e-3 + 1e-6 / radius)) << aperture;
        EXPECT_NEAR(inner_half, kSamples / 2.0, 5 * std::sqrt(kSamples / 4.0)) << aperture;
    }
}

// Of natural size, the sun's solid angle is that of 0.5358° to all digits of a float: its cosine alone has half a per
// cent.
TEST(Sun, PowerDoesNotDependOnItsAperture) {
    const auto power = [](double aperture) {
        const Scene scene =
            daylight("sun", std::string(kSunInZ) + float_element("sun_aperture", aperture));
        return scene.emitters().front()->power();
    };
    for (const double aperture : {0.01, 0.1, 5.0, 60.0})
        EXPECT_NEAR(power(aperture) / power(0.5358), 1, 1e-5) << aperture;
}

// Mitsuba 3.9.1: up is z; sun_direction is in world space.
TEST(Daylight, StandsAsInMitsuba3) {
    const Scene sun = daylight("sunsky", kSunInZ);
    EXPECT_GT(radiance(sun, normalize(Vec3{0, 0.6f, 0.8f})).r, 1e4f);
    EXPECT_GT(radiance(sun, {0, 0, 1}).b, 0);
    EXPECT_EQ(radiance(sun, {0, 0.6f, -0.8f}), Rgb());
    // South, west and up of the default time and place.
    const Scene tokyo = daylight("sunsky", "");
    EXPECT_GT(radiance(tokyo, normalize(Vec3{0.0513854f, 0.691748f, 0.720308f})).r, 1e4f);
    // Turned about x: up is -y, the sun stays where it is.
    const Scene turned = daylight(
        "sunsky", "<vector name=\"sun_direction\" x=\"0\" y=\"-0.6\" z=\"0.8\"/><transform "
                  "name=\"to_world\"><rotate x=\"1\" angle=\"90\"/></transform>");
    EXPECT_GT(radiance(turned, normalize(Vec3{0, -0.6f, 0.8f})).r, 1e4f);
    EXPECT_GT(radiance(turned, {0, -1, 0}).b, 0);
    EXPECT_EQ(radiance(turned, {0, 1, 0}), Rgb());
}

// In 0.6 up is y, and the sun's default stands in the west-south-west: east is x, south z.
TEST(Daylight, StandsAsInMitsuba06InItsFiles) {
    const Scene scene = daylight("sunsky", "", "0.6.0");
    EXPECT_GT(radiance(scene, normalize(Vec3{-0.691748f, 0.720308f, 0.0513854f})).r, 1e4f);
    EXPECT_GT(radiance(scene, {0, 1, 0}).b, 0);
    EXPECT_EQ(radiance(scene, {0, -1, 0}), Rgb());
}

TEST(Daylight, IsBlackAtNight) {
    const Scene scene =
        daylight("sunsky", "<vector name=\"sun_direction\" x=\"0\" y=\"1\" z=\"-0.1\"/>");
    EXPECT_EQ(radiance(scene, {0, 0, 1}), Rgb());
}

}  // namespace
}  // namespace etendue::test
