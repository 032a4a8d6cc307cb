// What chains learn before they start.

#include <map>

#include <gtest/gtest.h>

#include <fmt/format.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

// Walks without roulette would not end there.
TEST(ChainPilot, EndsInAClosedRoom) {
    const Scene scene =
        build(sensor("0,0,0.5", "0,0,0", 8) + sphere("0,0,0", "2", diffuse("0.95,0.95,0.95")) +
              sphere("0.3,0.2,-0.4", "0.1",
                     diffuse("0.5,0.5,0.5") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                              "value=\"1,1,1\"/></emitter>"));
    for (const char* name :
         {"pssmlt:groups=2,chains=16", "mmlt:groups=2,chains=16", "mlt:groups=2,chains=16"}) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(name);
        settings.spp = 1;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, std::atomic<bool>{false});
        const RenderStats& stats = renderer.stats();
        EXPECT_LT(double(stats.walk_rays), 200 * double(stats.eye_paths + stats.light_paths))
            << name;
    }
}

std::map<std::string, double> figures(const Scene& scene, const std::string& integrator) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator + ",groups=2,chains=16");
    settings.spp = 2;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>{false});
    std::map<std::string, double> out;
    for (const auto& [name, value] : renderer.integrator().figures()) out[name] = value;
    return out;
}

/// A small lamp that shines downwards.
std::string lamp(const std::string& translation) {
    return rectangle("<scale value=\"0.005\"/><rotate x=\"1\" angle=\"90\"/><translate " +
                         translation + "/>",
                     diffuse("0,0,0") + "<emitter type=\"area\"><rgb name=\"radiance\" "
                                        "value=\"9999,9999,9999\"/></emitter>");
}

// A sample chooses one of the lamps by power, so many lamps make direct light noisy, and one small lamp does not. The noise counts
// at a given film point, since chains have that of a textured surface as well.
TEST(ChainPilot, MutationsFollowTheNoise) {
    const std::string checkered =
        "<shape type=\"rectangle\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"><texture "
        "name=\"reflectance\" type=\"checkerboard\"><transform name=\"to_uv\"><scale "
        "value=\"20\"/></transform></texture></bsdf></bsdf></shape>";
    const std::string open = sensor("0,0,3", "0,0,0", 16) + room() + checkered;
    std::string lamps;
    for (int i = 0; i < 32; ++i)
        lamps += lamp(fmt::format("x=\"{}\" y=\"-0.9\" z=\"{}\"", -0.9 + 0.25 * (i % 8),
                                  0.1 + 0.25 * (i / 8)));
    const Scene one = build(open + lamp("y=\"0.9\" z=\"0.9\"")), many = build(open + lamps);
    for (const std::string name :
         {"mlt:p_large=0.1,lights=power", "mmlt:p_large=0.1,lights=power"}) {
        // As many as take eight times as long as direct light.
        EXPECT_DOUBLE_EQ(figures(one, name)["mutations_per_pixel"], 8 / 1.25) << name;
        EXPECT_LT(figures(many, name)["mutations_per_pixel"], 2) << name;
    }
}

TEST(ChainPilot, GivenMutationsAreMade) {
    const Scene scene = build(sensor("0,0,3", "0,0,0", 16) + room() + area_lamp());
    for (const auto& [given, per_pixel] : {std::pair("2.5", 2.5), {"0.5", 0.5}}) {
        const auto made = figures(scene, std::string("pssmlt:mutations=") + given);
        EXPECT_EQ(made.at("mutations_per_pixel"), per_pixel);
        EXPECT_EQ(made.at("large_proposed") + made.at("small_proposed") + made.at("block_proposed"),
                  2 * 16 * 16 * per_pixel);
    }
}

}  // namespace
}  // namespace etendue::test
