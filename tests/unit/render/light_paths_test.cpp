// Light paths of a pass: their memory, and methods that are one another with some options.

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

Scene small_room() {
    return build(mixed_room(front_camera(8)));
}

RenderSettings settings_of(const std::string& integrator, uint64_t spp) {
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
        Renderer renderer(scene, settings_of(integrator, 4));
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
        Renderer renderer(scene, settings_of("pcbpt:record_fraction=0,max_depth=2," + options, 1));
        renderer.run([](const Progress&) {}, std::atomic<bool>(false));
        return figure(renderer, "path_bytes");
    };
    const double needed = bytes("light_paths=4000");
    EXPECT_GT(needed, 4000 * (double(sizeof(SubPath)) + 2 * sizeof(Vertex)));
    const int mebibytes = int(needed / (1 << 20));
    EXPECT_THROW(bytes("light_paths=4000,memory=" + std::to_string(mebibytes)), std::runtime_error);
}

}  // namespace
}  // namespace etendue::test
