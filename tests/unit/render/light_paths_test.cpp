// Light paths of a pass: their memory, and methods that are one another with some options.

#include <regex>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

Scene small_room() {
    return build(mixed_room(front_camera(8)));
}

RenderSettings settings_with(const std::string& integrator, uint64_t spp) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.spp = spp;
    return settings;
}

double figure(const Renderer& renderer, const std::string& name) {
    for (const auto& [known, value] : renderer.integrator().figures())
        if (known == name) return value;
    ADD_FAILURE() << name;
    return 0;
}

TEST(LightPaths, VcmWithoutMergesIsBdpt) {
    const Scene scene = small_room();
    const auto image = [&](const char* integrator) {
        Renderer renderer(scene, settings_with(integrator, 4));
        renderer.run([](const Progress&) {}, std::atomic<bool>(false));
        return renderer.film().image();
    };
    const std::vector<Rgb> vcm = image("vcm:merges=false"), bdpt = image("bdpt");
    for (size_t i = 0; i < bdpt.size(); ++i)
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(vcm[i][c], bdpt[i][c], 1e-3f * (0.1f + bdpt[i][c])) << i;
}

TEST(LightPaths, StoredPathsHaveNoMoreMemoryThanTheirVertices) {
    SubPath path;
    path.reserve(3);
    EXPECT_EQ(path.memory_bytes(), 3 * sizeof(Vertex));
    for (int i = 0; i < 3; ++i) path.append();
    EXPECT_EQ(path.memory_bytes(), 3 * sizeof(Vertex));
}

/// What `memory` limits is what is allocated.
TEST(LightPaths, PcbptStaysWithinItsMemory) {
    const Scene scene = build(mixed_room(front_camera(64)));
    const auto bytes = [&](const std::string& options) {
        Renderer renderer(scene,
                          settings_with("pcbpt:record_fraction=0,max_depth=2," + options, 1));
        renderer.run([](const Progress&) {}, std::atomic<bool>(false));
        return figure(renderer, "path_bytes");
    };
    const double needed = bytes("light_paths=4000");
    EXPECT_GT(needed, 4000 * (double(sizeof(SubPath)) + 2 * sizeof(Vertex)));
    const int mebibytes = int(needed / (1 << 20));
    EXPECT_THROW(bytes("light_paths=4000,memory=" + std::to_string(mebibytes)), std::runtime_error);
}

class LightPathMemory : public ::testing::TestWithParam<const char*> {};

/// Where the number of light paths is not given, those of every pass fit into the memory, also where walks are guided or may
/// end on the lens.
TEST_P(LightPathMemory, SufficesForTheirNumber) {
    const std::string method = GetParam();
    // In the second scene, surfaces are guided, so that vertices need more memory.
    const bool is_guided = method.find("guide=on") != std::string::npos;
    const Scene scene =
        build(is_guided ? lantern_room(lens_camera(64)) : mixed_room(lens_camera(64)));
    constexpr uint64_t kPasses = 20;
    RenderSettings settings = settings_with(method + ",memory=1", kPasses);
    settings.threads = 2;
    Renderer renderer(scene, settings);
    EXPECT_LT(renderer.integrator().light_paths(scene), 2000u);
    renderer.run([](const Progress&) {}, std::atomic<bool>(false));
    EXPECT_EQ(renderer.film().passes(), kPasses);
}

INSTANTIATE_TEST_SUITE_P(Methods, LightPathMemory,
                         ::testing::Values("vcm:alpha=1", "vcm:guide=on,guide_walks=8000",
                                           "upg:max_depth=8", "upg+bdpt:guide=on,guide_walks=8000",
                                           "sppm:max_depth=2", "ppm:max_depth=8"),
                         [](const auto& p) {
                             const std::string name = p.param;
                             return std::regex_replace(name, std::regex("[^a-z0-9]+"), "_");
                         });

}  // namespace
}  // namespace etendue::test
