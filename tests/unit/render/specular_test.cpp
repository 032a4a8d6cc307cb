// Specular connections as an option of methods: where they are used, and what they leave as it is.

#include <atomic>
#include <cstring>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

struct SpecularRendering {
    std::vector<Rgb> image;
    RenderStats stats;
    std::vector<std::pair<std::string, double>> figures;

    /// What specular_connections=auto has decided.
    bool uses_them() const {
        for (const auto& [name, value] : figures)
            if (name == "specular_connections") return value > 0;
        ADD_FAILURE() << "no such figure";
        return false;
    }
};

SpecularRendering render(const Scene& scene, const std::string& method, int threads = 2) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(method);
    settings.threads = threads;
    settings.spp = 2;
    std::unique_ptr<Integrator> integrator = make_integrator(settings.integrator);
    const Integrator& used = *integrator;
    Renderer r(scene, settings, std::move(integrator));
    r.run([](const Progress&) {}, std::atomic<bool>{false});
    return {r.film().image(), r.stats(), used.figures()};
}

bool same_bits(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Rgb)) == 0;
}

constexpr int kSize = 24;
const char* const kMethods[] = {"path", "bdpt", "pcbpt", "upg+bdpt"};

std::string point_light(const std::string& position) {
    return "<emitter type=\"point\"><point name=\"position\" value=\"" + position +
           "\"/></emitter>";
}

TEST(SpecularOption, SearchesNothingWhereNoChainCanBe) {
    const Scene scene = build(front_camera(kSize) + room() + area_lamp() +
                              sphere("0,-0.4,0", "0.4", "<bsdf type=\"roughdielectric\"/>"));
    for (const std::string method : kMethods) {
        const SpecularRendering off = render(scene, method),
                                on = render(scene, method + ":specular_connections=on");
        EXPECT_EQ(on.stats.chain_seeds, 0u) << method;
        EXPECT_EQ(on.stats.rays(), off.stats.rays()) << method;
        EXPECT_TRUE(same_bits(on.image, off.image)) << method;
    }
}

TEST(SpecularOption, AutoFindsLightThatNothingElseMakes) {
    const Scene scene = build(front_camera(kSize) + room() + sphere("0,0.3,0", "0.3", kGlass) +
                              point_light("0,0.3,0"));
    for (const std::string method : kMethods) {
        const SpecularRendering on = render(scene, method + ":specular_connections=on"),
                                automatic = render(scene, method + ":specular_connections=auto");
        // Where splats make the caustic, this is the one that is seen through the ball.
        EXPECT_TRUE(automatic.uses_them()) << method;
        EXPECT_TRUE(same_bits(automatic.image, on.image)) << "the decision has no other effect";
    }
}

TEST(SpecularOption, AutoLeavesLargeLampsToHits) {
    const Scene scene = build(front_camera(kSize) + room() + sphere("0,-0.4,0", "0.4", kGlass) +
                              "<emitter type=\"constant\"/>");
    for (const std::string method : kMethods) {
        const SpecularRendering off = render(scene, method),
                                automatic = render(scene, method + ":specular_connections=auto");
        EXPECT_FALSE(automatic.uses_them()) << method;
        EXPECT_TRUE(same_bits(automatic.image, off.image)) << method;
        EXPECT_EQ(automatic.stats.chain_seeds, 0u) << "the pilot is not a part of the rendering";
    }
}

/// Through glass with facets, each of which may have a way to the lamp. Without photons a way would need some fifty trials.
TEST(SpecularOption, FindsChainsByPhotons) {
    const Scene scene =
        build(front_camera(kSize) + room() +
              "<shape type=\"obj\"><string name=\"filename\" value=\"" ETENDUE_SOURCE_DIR
              "/tests/scenes/icosahedron.obj\"/><boolean name=\"face_normals\" "
              "value=\"true\"/><transform "
              "name=\"to_world\"><scale value=\"0.4\"/><translate y=\"0.2\"/></transform>" +
              kGlass + "</shape>" + point_light("0.2,0.9,0.1"));
    const RenderStats stats = render(scene, "path:specular_connections=on,roulette=0").stats;
    EXPECT_GT(stats.chains, 100u);
    EXPECT_LT(double(stats.chain_trials) / double(stats.chains), 10);
}

TEST(SpecularOption, AutoDoesNotDependOnThreads) {
    const Scene scene = build(lantern_room(front_camera(kSize)));
    const SpecularRendering one = render(scene, "path:specular_connections=auto", 1),
                            more = render(scene, "path:specular_connections=auto", 3);
    EXPECT_EQ(one.uses_them(), more.uses_them());
    EXPECT_TRUE(same_bits(one.image, more.image));
}

}  // namespace
}  // namespace etendue::test
