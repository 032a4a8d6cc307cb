// The integrator of docs/adding-an-integrator.md works as described there.

#include <cstring>
#include <string>

#include <gtest/gtest.h>

#include "render_tiles.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

Scene lit_room() {
    return build(front_camera(8) + room() + area_lamp());
}

TEST(Example, DirectLightHasTheBitsOfPath) {
    const Scene scene = lit_room();
    const auto image = [&](const std::string& integrator) {
        RenderSettings settings;
        settings.integrator = IntegratorSpec::parse(integrator);
        settings.spp = 16;
        Renderer renderer(scene, settings);
        renderer.run([](const Progress&) {}, false);
        return renderer.film().image();
    };
    const std::vector<Rgb> direct = image("direct"), path = image("path:max_depth=2");
    ASSERT_EQ(direct.size(), path.size());
    EXPECT_EQ(std::memcmp(direct.data(), path.data(), path.size() * sizeof(Rgb)), 0);
}

TEST(Example, DirectLightWithoutNextEventsHasTheMeansOfPath) {
    const Scene scene = lit_room();
    expect_same_image(render_tiles(scene, "direct:next_event=false", {8192}),
                      render_tiles(scene, "path:max_depth=2", {1024, 4, 2}), 0.1, "direct");
}

}  // namespace
}  // namespace etendue::test
