// Markov chains begin in a closed room too, where walks without roulette would not end.

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

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

}  // namespace
}  // namespace etendue::test
