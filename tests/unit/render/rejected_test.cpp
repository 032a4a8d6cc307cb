// Contributions that are not finite are left out, and counted.

#include <atomic>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

class NotFinite : public ::testing::TestWithParam<const char*> {};

/// A lamp so large that the power of its light paths is beyond the range of numbers, though its radiance is not: direct light
/// is finite, and what chains and photons carry is not.
TEST_P(NotFinite, PathsAreCounted) {
    const Scene scene = build(
        sensor("0,400,0", "0,0,1", 8, "60") +
        rectangle("<scale value=\"1000\"/><rotate x=\"1\" angle=\"-90\"/>", diffuse("0.5")) +
        rectangle("<scale value=\"1000\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"500\"/>",
                  diffuse("0.5") + "<emitter type=\"area\"><float name=\"radiance\" "
                                   "value=\"1e33\"/></emitter>"));
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(GetParam());
    settings.threads = 1;
    settings.spp = 4;
    Renderer renderer(scene, settings);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    EXPECT_GT(renderer.stats().rejected, 0u);
    for (const Rgb c : renderer.film().image()) ASSERT_TRUE(is_finite(c));
}

INSTANTIATE_TEST_SUITE_P(Chains, NotFinite,
                         ::testing::Values("pssmlt:chains=16,groups=2", "mmlt:chains=16,groups=2",
                                           "mlt:chains=16,groups=2", "mps:mutations=2000",
                                           "pm:light_paths=2000", "upg+pssmlt:chains=16,groups=2",
                                           "vcm", "bdpt"));

}  // namespace
}  // namespace etendue::test
