// The radius that gathers choose is such that an eye path finds so many pairs, whatever Russian roulette leaves of them.

#include <cmath>

#include <gtest/gtest.h>

#include "math/statistics.h"
#include "render/renderer.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

struct Chosen {
    double radius;
    uint64_t pairs;  ///< That were looked at.
};

/// After the choice before the last of `passes`.
Chosen chosen(const Scene& scene, const std::string& integrator, uint64_t seed, int passes = 5) {
    RenderSettings settings;
    settings.integrator = IntegratorSpec::parse(integrator);
    settings.seed = seed;
    settings.spp = passes;
    Renderer renderer(scene, settings);
    const std::atomic<bool> interrupted{false};
    renderer.run([](const Progress&) {}, interrupted);
    for (const auto& [name, value] : renderer.integrator().figures())
        if (name == "radius") return {value, renderer.stats().pairs};
    ADD_FAILURE() << "no radius";
    return {};
}

TEST(GatherRadius, DoesNotDependOnRoulette) {
    const Scene scene = build(front_camera(16) + room() + area_lamp());
    const std::string integrator = "upg:light_paths=60000,max_depth=5";
    constexpr int kSeeds = 8;
    // Radii are such that their squares are inversely proportional to the numbers of pairs: of these the mean is right,
    // however much roulette spreads them.
    Moments ratio;
    double left = 0;
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
        const Chosen with = chosen(scene, integrator + ",roulette=1", seed),
                     without = chosen(scene, integrator + ",roulette=0", seed);
        ratio.add(sqr(without.radius / with.radius));
        left += double(with.pairs) / double(without.pairs) / kSeeds;
    }
    EXPECT_LT(left, 0.75) << "roulette hardly plays";
    const double error = std::sqrt(ratio.squared_error());
    EXPECT_LT(error, 0.06) << "too few samples";
    EXPECT_NEAR(ratio.mean(), 1, 4 * error);
    EXPECT_GT(std::fabs(left - 1), 6 * error) << "the number after roulette could be taken for it";
    RecordProperty("ratio", std::to_string(ratio.mean()) + " ± " + std::to_string(error));
}

/// The walks before the first pass tell its radius. The size of the scene does not: something small is far away.
TEST(GatherRadius, OfTheFirstPassFindsAboutEightPairs) {
    const Scene scene =
        build(front_camera(16) + room() + area_lamp() +
              R"(<shape type="sphere"><point name="center" x="0" y="0" z="-1000000"/>
                              <float name="radius" value="0.01"/><bsdf type="diffuse"/></shape>)");
    constexpr int kSeeds = 8;
    Moments pairs;
    for (uint64_t seed = 0; seed < kSeeds; ++seed)
        pairs.add(double(chosen(scene, "upg+bdpt:light_paths=60000", seed, 1).pairs) / sqr(16.0));
    RecordProperty("pairs", std::to_string(pairs.mean()));
    EXPECT_GT(pairs.mean(), 4);
    EXPECT_LT(pairs.mean(), 16);
}

/// Behind a shade, connections rarely see the lamp's light, and pairs are worth their time. In the open they are not.
TEST(GatherRadius, IsLargerWherePairsAreWorthMore) {
    const std::string shade =
        rectangle("<scale value=\"0.5\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"0.85\"/>",
                  diffuse("0.5,0.5,0.5"));
    const Scene open = build(front_camera(32) + room() + area_lamp()),
                shaded = build(front_camera(32) + room() + area_lamp() + shade);
    const auto relative_to_eight_pairs = [](const Scene& scene, uint64_t seed) {
        return chosen(scene, "upg+bdpt:light_paths=4000", seed, 17).radius /
               chosen(scene, "upg:light_paths=4000", seed, 17).radius;
    };
    constexpr int kSeeds = 10;
    Moments in_the_open, behind_the_shade;
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
        in_the_open.add(relative_to_eight_pairs(open, seed));
        behind_the_shade.add(relative_to_eight_pairs(shaded, seed));
    }
    RecordProperty("open", std::to_string(in_the_open.mean()));
    RecordProperty("shaded", std::to_string(behind_the_shade.mean()));
    const double difference = behind_the_shade.mean() - in_the_open.mean(),
                 error = std::sqrt(in_the_open.squared_error() + behind_the_shade.squared_error());
    RecordProperty("error", std::to_string(error));
    EXPECT_LT(in_the_open.mean(), 1);
    EXPECT_GT(difference, 4 * error);
}

}  // namespace
}  // namespace etendue::test
